//! The reference of the language for users.

/// The expression language on one page, in plain text.
pub const HELP: &str = "\
Expressions

A param:         \"0.6 + 0.1*sin(2*pi*time)\"
A vector param:  \"vec(cos(time), 0, sin(time))\" or [\"cos(time)\", 0, \"sin(time)\"]
Attribute_Expr:  envelope = clamp(envelope*P.y, 0, 1)
                 let sway = 0.1*noise(P*3 + vec(time, 0, 0))
                 P.x += sway*envelope

Names
  frame            frame number, with fraction between frames
  time             seconds, frame / fps
  fps              frames per second
  seed             the scene's seed
  pi               3.14159...
  controls         by name; .x .y .z of vectors; a control can use those before it
  In Attribute_Expr also:
  attributes       by name; @name is always the attribute, even if something else has that name
  i                index of the point or element, from 0
  count            number of points or elements

Values
  Numbers, and vectors of 3 or 4 components: .x .y .z .w or .r .g .b .a.
  Operators and functions work component by component; a number is used for every component.
  Angles are in radians.

Operators, highest precedence first
  ^                power; 2^3^2 = 2^9, -2^2 = -4
  - + !            sign, logical not
  * / %            remainder a % b has the sign of b: -1 % 24 = 23
  + -
  < <= > >=        1 if true, else 0; numbers only, not chained: a < b && b < c
  == !=
  &&
  ||
  a ? b : c        b if a is not 0, else c; the other may be NaN

Functions
  sin cos tan asin acos atan(x)   atan2(y, x)   radians(degrees)   degrees(radians)
  sqrt(x)   exp(x)   log(x)       natural logarithm; base 2: log(x)/log(2)
  pow(x, y)                       x^y
  mod(x, y)                       x % y
  abs(x)   sign(x)                sign: -1, 0 or 1
  floor(x)   ceil(x)   round(x)   round: halves away from zero
  fract(x)                        x - floor(x)
  min(a, b, ...)   max(a, b, ...)
  clamp(x, low, high)             low if x < low, high if x > high
  mix(a, b, t)                    a at t = 0, b at t = 1
  step(edge, x)                   0 if x < edge, else 1
  smoothstep(low, high, x)        0 if x < low, 1 if x > high, smooth between
  fit(x, a, b, c, d)              maps range a..b to range c..d, clamped
  noise(P)   noise(x, y, z)       smooth noise, about -1..1, 0 at whole x, y, z; depends on the seed
  rand(i)   rand(i, j)            random number, 0 <= r < 1, for i and j; depends on the seed
  vec(x, y, z)   vec(x, y, z, w)  a vector; vec(x) is vec(x, x, x)
  length(v)   distance(a, b)   dot(a, b)   cross(a, b)
  normalize(v)                    v scaled to length 1; 0 if v is 0

Attribute_Expr
  One assignment per line, or several separated by ; . Each line sees the results of those above.
  name = ...       creates or changes an attribute; name.y = ... changes one component
  += -= *= /=      change an existing attribute
  let name = ...   names a value for the lines below, without creating an attribute
  ( )              inside brackets an expression may continue on the next line
  // ...           comment, to the end of the line
  A new attribute has the type of its value, number or vector; an existing one keeps its type, and
  integer attributes are rounded. A value that is not finite or too large is an error.
";

#[cfg(test)]
mod tests {
    use super::super::functions::FUNCTIONS;
    use super::*;

    #[test]
    fn every_function_is_explained() {
        let functions = HELP.split("\nFunctions\n").nth(1).unwrap();
        let words: Vec<&str> = functions.split(|c: char| !c.is_alphanumeric()).collect();
        for function in FUNCTIONS {
            assert!(words.contains(&function.name), "{}", function.name);
        }
    }

    #[test]
    fn lines_fit_a_terminal() {
        assert!(HELP.lines().all(|line| line.len() <= 100));
    }
}
