//! The reference of the language as the program prints it.

/// The expression language on one page, in plain text.
pub const HELP: &str = "\
Expressions

A param:         \"0.6 + 0.1*sin(2*pi*time)\"
A vector param:  [\"cos(time)\", \"0\", \"sin(time)\"]
Attribute_Expr:  envelope = clamp(envelope*P.y, 0, 1)
                 let sway = 0.1*noise(P*3 + vec(time, 0, 0))
                 P.x += sway*envelope

Names
  frame            frame number, with fraction between frames
  time             seconds, frame / fps
  fps              frames a second
  seed             the scene's seed
  pi               3.14159...
  controls         by their names; .x .y .z of those that are vectors
  In Attribute_Expr also:
  attributes       by their names; @name is always the attribute, whatever else has that name
  i                number of the point or element, from 0
  count            how many there are

Values
  Numbers and vectors of 3 or 4. .x .y .z .w, or .r .g .b .a, is one component.
  Operators and functions work component by component; a number stands for every component.
  Angles are radians.

Operators, from the tightest
  ^                power; 2^3^2 = 2^9, -2^2 = -4
  - + !            signs, logical not
  * / %            a % b is from 0 to b: -1 % 24 = 23
  + -
  < <= > >=        1 or 0, of numbers; write a < b && b < c
  == !=
  &&
  ||
  a ? b : c        b where a is not 0, else c; what is not chosen does not matter

Functions
  sin cos tan asin acos atan(x)   atan2(y, x)   radians(degrees)   degrees(radians)
  sqrt(x)   exp(x)   log(x)       log is natural; log(x)/log(2) is to base 2
  pow(x, y)                       x^y
  mod(x, y)                       x % y
  abs(x)   sign(x)                sign: -1, 0 or 1
  floor(x)   ceil(x)   round(x)   round: halves away from zero
  fract(x)                        x - floor(x)
  min(a, b, ...)   max(a, b, ...)
  clamp(x, low, high)             low where x < low, high where x > high
  mix(a, b, t)                    a at t = 0, b at t = 1
  step(edge, x)                   0 where x < edge, else 1
  smoothstep(low, high, x)        0 up to low, 1 from high, smooth between
  fit(x, a, b, c, d)              from range a..b to range c..d, clamped
  noise(P)   noise(x, y, z)       smooth, about -1..1, 0 on whole numbers; the seed chooses
  rand(i)   rand(i, j)            from 0 up to 1, jumps with every change of i; the seed chooses
  vec(x, y, z)   vec(x, y, z, w)  a vector; vec(x) is vec(x, x, x)
  length(v)   distance(a, b)   dot(a, b)   cross(a, b)
  normalize(v)                    v at length 1; 0 where v is 0

Attribute_Expr
  One assignment a line, or divided by ;. Each line sees what the lines above it made.
  name = ...       makes or changes an attribute; name.y = ... one component of it
  += -= *= /=      change what is there
  let name = ...   names a value for the lines below and makes no attribute
  ( )              between them an expression goes on over lines
  // ...           a comment, to the end of the line
  A new attribute is a number or a vector as its value is; one that is there keeps its type,
  and of whole numbers it takes the nearest. A value that is not finite or too large is an error.
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
