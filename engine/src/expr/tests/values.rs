//! Values of expressions, compared with values computed by hand.

use std::f64::consts::PI;

use super::*;

#[test]
fn operators_have_the_precedence_of_c() {
    for (text, value) in [
        ("1 + 2*3", 7.0),
        ("(1 + 2)*3", 9.0),
        ("8 - 4 - 2", 2.0),
        ("8/4/2", 1.0),
        ("7 % 4 * 2", 6.0),
        ("1 + 1 == 2", 1.0),
        ("1 < 2 == 2 > 1", 1.0),
        ("0 && 0 || 1", 1.0),
        ("1 || 0 && 0", 1.0),
        ("1 - 1 || 2 < 1", 0.0),
        ("!0 + 1", 2.0),
        ("!(0 + 1)", 0.0),
        ("!2 == 0", 1.0),
        ("1 ? 2 : 0 ? 3 : 4", 2.0),
        ("0 ? 2 : 0 ? 3 : 4", 4.0),
        ("1 ? 0 ? 2 : 3 : 4", 3.0),
        ("1 || 0 ? 5 : 6", 5.0),
        ("- - 2", 2.0),
        ("+2 - +3", -1.0),
    ] {
        assert_eq!(eval(text), value, "{text}");
    }
}

#[test]
fn power_binds_tighter_than_a_sign_and_is_right_associative() {
    for (text, value) in [
        ("-2^2", -4.0),
        ("(-2)^2", 4.0),
        ("2^3^2", 512.0),
        ("2^-1", 0.5),
        ("2^-1^2", 0.5),
        ("2*3^2", 18.0),
        ("-wind.y^2", -4.0),
        ("(-8)^3", -512.0),
        ("9^0.5", 3.0),
    ] {
        assert_eq!(eval(text), value, "{text}");
    }
}

#[test]
fn names_have_their_values() {
    assert_eq!(eval("frame"), 36.0);
    assert_eq!(eval("time"), 1.5);
    assert_eq!(eval("fps"), 24.0);
    assert_eq!(eval("seed"), 7.0);
    assert_eq!(eval("pi"), PI);
    assert_eq!(eval("strength"), 0.75);
    assert_eq!(eval("wind.x + 10*wind.g + 100*wind.z"), 321.0);
}

#[test]
fn numbers_are_read_in_every_form() {
    for (text, value) in [("2.", 2.0), (".5", 0.5), ("1e3", 1e3), ("2.5E-2", 0.025), ("007", 7.0)] {
        assert_eq!(eval(text), value, "{text}");
    }
}

#[test]
fn blanks_line_breaks_and_comments_are_ignored() {
    assert_eq!(eval(" 1\n\t+ // one\r\n2 "), 3.0);
}

#[test]
fn functions_have_the_expected_values() {
    for (text, value) in [
        ("sin(0) + cos(0) + tan(0)", 1.0),
        ("asin(1)", PI / 2.0),
        ("acos(-1)", PI),
        ("atan(1)", PI / 4.0),
        ("atan2(1, -1)", 3.0 * PI / 4.0),
        ("radians(180)", PI),
        ("degrees(pi)", 180.0),
        ("sqrt(2.25)", 1.5),
        ("exp(0) + log(1)", 1.0),
        ("pow(2, 10)", 1024.0),
        ("mod(-1, 24)", 23.0),
        ("-1 % -24", -1.0),
        ("abs(-3)", 3.0),
        ("sign(-3) + sign(0)", -1.0),
        ("floor(-1.5)", -2.0),
        ("ceil(-1.5)", -1.0),
        ("round(2.5) + round(-2.5)", 0.0),
        ("round(1.49)", 1.0),
        ("fract(-0.25)", 0.75),
        ("min(3, 1, 2)", 1.0),
        ("max(3, 1, 2, 8)", 8.0),
        ("clamp(5, 0, 1)", 1.0),
        ("clamp(-5, 0, 1)", 0.0),
        ("mix(2, 4, 0.25)", 2.5),
        ("step(1, 1)", 1.0),
        ("step(1, 0.999)", 0.0),
        ("smoothstep(0, 2, 1)", 0.5),
        ("smoothstep(0, 1, 0.25)", 0.15625),
        ("smoothstep(2, 0, 0.5)", 0.84375),
        ("smoothstep(1, 1, 1)", 1.0),
        ("smoothstep(1, 1, 0.9)", 0.0),
        ("fit(5, 0, 10, 100, 200)", 150.0),
        ("fit(-5, 0, 10, 100, 200)", 100.0),
        ("length(-2)", 2.0),
        ("length(vec(2, 3, 6))", 7.0),
        ("length(vec(1, 1, 1, 1))", 2.0),
        ("distance(vec(1, 1, 1), vec(3, 4, 7))", 7.0),
        ("dot(wind, wind)", 14.0),
        ("dot(vec(1, 2, 3, 4), vec(1, 1, 1, 2))", 14.0),
        ("cross(vec(1, 0, 0), vec(0, 1, 0)).z", 1.0),
        ("cross(wind, vec(4, 5, 6)).x", -3.0),
        ("cross(wind, vec(4, 5, 6)).y", 6.0),
        ("cross(wind, vec(4, 5, 6)).z", -3.0),
        ("normalize(vec(0, 3, 4)).z", 0.8),
        ("length(normalize(vec(0)))", 0.0),
        ("vec(3).y", 3.0),
        ("vec(1, 2, 3, 4).w", 4.0),
    ] {
        let found = eval(text);
        assert!((found - value).abs() <= 1e-15 * value.abs().max(1.0), "{text} is {found}");
    }
}

#[test]
fn mix_and_fit_are_exact_at_their_ends() {
    assert_eq!(eval("mix(0.1, 0.3, 1)"), 0.3);
    assert_eq!(eval("mix(0.1, 0.3, 0)"), 0.1);
    assert_eq!(eval("fit(0.7, 0.1, 0.7, 0.2, 0.9)"), 0.9);
}

#[test]
fn functions_work_component_by_component() {
    for (text, value) in [
        ("(wind*2 - 1).z", 5.0),
        ("(1/wind).y", 0.5),
        ("(-wind).x", -1.0),
        ("(wind + vec(10, 20, 30)).y", 22.0),
        ("(wind^2).z", 9.0),
        ("(wind % 2).z", 1.0),
        ("clamp(wind, 0, 1.5).y", 1.5),
        ("min(wind, 2.5).z", 2.5),
        ("max(vec(5, 0, 0), wind, 2).x", 5.0),
        ("mix(wind, vec(0), 0.5).z", 1.5),
        ("floor(wind*0.5).z", 1.0),
        ("(strength > 0.5 ? wind : 0).y", 2.0),
        ("(strength < 0.5 ? wind : 0).y", 0.0),
        ("fract(vec(1.25)).x", 0.25),
    ] {
        assert_eq!(eval(text), value, "{text}");
    }
}

#[test]
fn a_selection_ignores_the_other_value() {
    assert_eq!(eval("time == 0 ? 1/0 : 2"), 2.0);
    assert_eq!(eval("time ? 2 : 0/0"), 2.0);
    assert_eq!(eval("time == 0 && 1/0"), 0.0);
    assert_eq!(eval("0 && 0/0"), 0.0);
    assert_eq!(eval("0/0 || 1"), 1.0);
}

#[test]
fn nan_and_infinity_propagate() {
    assert_eq!(eval("1/0"), f64::INFINITY);
    for text in ["0/0", "sqrt(-1)", "log(-1)", "1 % 0", "min(0/0, 1)", "clamp(0/0, 0, 1)", "max(1, 0/0)"] {
        assert!(eval(text).is_nan(), "{text}");
    }
    assert_eq!(eval("0/0 == 0/0"), 0.0);
}

#[test]
fn transcendental_functions_are_those_of_libm() {
    assert_eq!(eval("sin(time)").to_bits(), libm::sin(1.5).to_bits());
    assert_eq!(eval("2.5^time").to_bits(), libm::pow(2.5, 1.5).to_bits());
    assert_eq!(eval("exp(time)").to_bits(), libm::exp(1.5).to_bits());
}

#[test]
fn rand_depends_on_index_and_seed() {
    assert_eq!(eval("rand(3)"), eval("rand(3, 0)"));
    assert_ne!(eval("rand(3)"), eval("rand(4)"));
    assert_ne!(eval("rand(3, 4)"), eval("rand(4, 3)"));
    assert!((0.0..1.0).contains(&eval("rand(frame)")));
    let rand = Expr::parse("rand(3) + noise(0.5)", &SCOPE).unwrap();
    assert_eq!(rand.constant(), None);
    assert_ne!(rand.eval(&ENV), rand.eval(&Env { seed: 8.0, ..ENV }));
}

#[test]
fn noise_takes_coordinates_in_three_forms() {
    assert_eq!(eval("noise(wind*0.3)"), eval("noise(0.3, 0.6, wind.z*0.3)"));
    assert_eq!(eval("noise(0.3)"), eval("noise(0.3, 0)"));
    assert_eq!(eval("noise(0.3)"), eval("noise(0.3, 0, 0)"));
    assert!(eval("noise(1/0)").is_nan());
}

#[test]
fn constants_are_folded() {
    let constant = |text: &str| Expr::parse(text, &SCOPE).unwrap().constant();
    assert_eq!(constant("2*pi + sin(0)"), Some(2.0 * PI));
    assert_eq!(constant("1 ? 2 : time"), Some(2.0));
    assert_eq!(constant("time"), None);
    assert_eq!(constant("strength*0"), None);
}

#[test]
fn uses_are_exactly_what_the_value_depends_on() {
    let uses = |text: &str| Expr::parse(text, &SCOPE).unwrap().uses().clone();
    assert_eq!(uses("1 + 2"), Uses::default());
    assert_eq!(uses("frame/24"), Uses { time: true, ..Uses::default() });
    assert_eq!(uses("time*fps"), Uses { time: true, fps: true, ..Uses::default() });
    assert_eq!(uses("rand(1)"), Uses { seed: true, ..Uses::default() });
    assert_eq!(uses("wind.y + strength + wind.x"), Uses { controls: vec![0, 1], ..Uses::default() });
    assert_eq!(uses("0 ? time : wind.z"), Uses { controls: vec![1], ..Uses::default() });
}

#[test]
fn a_control_without_a_number_reads_as_nan() {
    let wind = Expr::parse("wind.z", &SCOPE).unwrap();
    assert!(wind.eval(&Env { controls: &[1.0], ..ENV }).is_nan());
}

#[test]
fn more_values_than_fit_on_the_stack_are_allocated() {
    let text: Vec<String> = (0..500).map(|k| format!("sin(time*{k})")).collect();
    let sum = (0..500).fold(0.0, |sum, k| sum + libm::sin(1.5 * f64::from(k)));
    assert_eq!(eval(&text.join(" + ")), sum);
}
