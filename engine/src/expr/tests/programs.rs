//! Programs over columns.

use super::super::parser::MAX_FAULTS;
use super::*;
use crate::geometry::Column;

fn f1(rows: &[f32]) -> Column {
    Column::new(rows.to_vec())
}

fn f3(rows: &[[f32; 3]]) -> Column {
    Column::new(rows.to_vec())
}

fn run(text: &str, columns: &[(&str, &Column)]) -> Result<Vec<(String, Column)>, RunError> {
    let program = Program::parse(text, &SCOPE).unwrap_or_else(|faults| panic!("{text}: {faults:?}"));
    let rows = columns.first().map_or(0, |(_, column)| column.len());
    program.run(&ENV, columns, rows)
}

/// The columns written by a program that runs over three points at x = 1, 2, 3, y = 0.5.
fn run_on_p(text: &str) -> Result<Vec<(String, Column)>, RunError> {
    run(text, &[("P", &f3(&[[1.0, 0.5, 0.0], [2.0, 0.5, 0.0], [3.0, 0.5, 0.0]]))])
}

#[track_caller]
fn check(text: &str, expected: &[(&str, Column)]) {
    let found = run_on_p(text).unwrap_or_else(|error| panic!("{text}: {error}"));
    let found: Vec<(&str, Column)> = found.iter().map(|(n, c)| (n.as_str(), c.clone())).collect();
    assert_eq!(found, expected, "{text}");
}

fn faults(text: &str) -> Vec<(usize, usize, String)> {
    let faults = Program::parse(text, &SCOPE).expect_err(text);
    faults.into_iter().map(|fault| (fault.line, fault.column, fault.fact)).collect()
}

#[test]
fn the_example_of_the_manual_runs() {
    let envelope = f1(&[1.0, 0.5, 8.0]);
    let p = f3(&[[0.0, 0.5, 0.0], [0.0, 2.0, 0.0], [0.0, 1.0, 0.0]]);
    let found = run("envelope = clamp(envelope*P.y, 0, 1)", &[("envelope", &envelope), ("P", &p)]);
    assert_eq!(found.unwrap(), [("envelope".to_owned(), f1(&[0.5, 1.0, 1.0]))]);
}

#[test]
fn a_new_attribute_is_as_wide_as_its_value() {
    check("a = P.x", &[("a", f1(&[1.0, 2.0, 3.0]))]);
    check("a = P*2", &[("a", f3(&[[2.0, 1.0, 0.0], [4.0, 1.0, 0.0], [6.0, 1.0, 0.0]]))]);
    check("a = vec(1, 2, 3, 4)", &[("a", Column::new(vec![[1.0f32, 2.0, 3.0, 4.0]; 3]))]);
    check("id = i*2 + count", &[("id", Column::new(vec![3, 5, 7]))]);
}

#[test]
fn single_components_can_be_changed() {
    check("P.z = P.x", &[("P", f3(&[[1.0, 0.5, 1.0], [2.0, 0.5, 2.0], [3.0, 0.5, 3.0]]))]);
    check("P.y += i; P.x *= 2", &[("P", f3(&[[2.0, 0.5, 0.0], [4.0, 1.5, 0.0], [6.0, 2.5, 0.0]]))]);
    check("P -= vec(1, 0.5, 0)", &[("P", f3(&[[0.0; 3], [1.0, 0.0, 0.0], [2.0, 0.0, 0.0]]))]);
}

#[test]
fn later_lines_see_the_results_of_earlier_ones() {
    check("a = 1\na = a + i; b = a", &[("a", f1(&[1.0, 2.0, 3.0])), ("b", f1(&[1.0, 2.0, 3.0]))]);
    check("a = P\na.x = 0\nP.x = a.x + a.y", &[("a", f3(&[[0.0, 0.5, 0.0]; 3])), ("P", f3(&[[0.5, 0.5, 0.0]; 3]))]);
}

#[test]
fn later_lines_see_the_rounded_value() {
    check("a = 0.1\nb = a == 0.1", &[("a", f1(&[0.1; 3])), ("b", f1(&[0.0; 3]))]);
    check("id = 2.5\nb = id", &[("id", Column::new(vec![3; 3])), ("b", f1(&[3.0; 3]))]);
}

#[test]
fn let_names_a_value_without_creating_an_attribute() {
    check("let h = P.y*2\nlet h = h + i\na = h", &[("a", f1(&[1.0, 2.0, 3.0]))]);
    check("let P = 7; a = P + @P.x", &[("a", f1(&[8.0, 9.0, 10.0]))]);
    check("let exact = 0.1; a = exact == 0.1", &[("a", f1(&[1.0; 3]))]);
}

#[test]
fn an_attribute_keeps_its_type() {
    let id = Column::new(vec![1, 2, 3]);
    let found = run("id = id*1.5", &[("id", &id)]).unwrap();
    assert_eq!(found, [("id".to_owned(), Column::new(vec![2, 3, 5]))]);
    let corner = Column::new(vec![[1, 2, 3]]);
    let found = run("corner.y = corner.z + 0.4", &[("corner", &corner)]).unwrap();
    assert_eq!(found, [("corner".to_owned(), Column::new(vec![[1, 3, 3]]))]);
}

#[test]
fn at_refers_to_an_attribute_hidden_by_another_name() {
    let time = f1(&[10.0, 20.0]);
    let found = run("@time = @time + time + strength", &[("time", &time)]).unwrap();
    assert_eq!(found, [("time".to_owned(), f1(&[12.25, 22.25]))]);
}

#[test]
fn controls_hide_attributes_of_the_same_name() {
    let strength = f1(&[5.0]);
    let found = run("a = strength; b = @strength", &[("strength", &strength)]).unwrap();
    assert_eq!(found, [("a".to_owned(), f1(&[0.75])), ("b".to_owned(), f1(&[5.0]))]);
}

#[test]
fn lines_comments_and_brackets_are_read() {
    check("\n; ; // nothing\r\n a = (1 // one\n + 2)\n\n", &[("a", f1(&[3.0; 3]))]);
    check("", &[]);
}

#[test]
fn without_rows_columns_are_empty() {
    let found = run("a = P.x", &[("P", &f3(&[]))]).unwrap();
    assert_eq!(found, [("a".to_owned(), f1(&[]))]);
}

#[test]
fn input_columns_are_not_changed() {
    let p = f3(&[[1.0, 2.0, 3.0]]);
    let held = p.clone();
    run("P.x = 9", &[("P", &p)]).unwrap();
    assert!(p.same(&held));
    assert_eq!(p, f3(&[[1.0, 2.0, 3.0]]));
}

#[test]
fn reads_and_writes_are_known_before_running() {
    let program = Program::parse("let t = time\na = P.x*wind.y; b.x = a + t; c = b; P.y = 0; d = 1", &SCOPE);
    let program = program.unwrap();
    assert_eq!(program.reads(), ["P", "b"]);
    assert_eq!(program.writes(), ["a", "b", "c", "P", "d"]);
    assert_eq!(program.uses(), &Uses { time: true, controls: vec![1], ..Uses::default() });
    let still = Program::parse("a = rand(i)", &SCOPE).unwrap();
    assert_eq!(still.uses(), &Uses { seed: true, ..Uses::default() });
}

#[test]
fn every_line_reports_its_first_fault() {
    let text = "a = 1 +\nb = 2\nP = 3\nc = clamp(1)\n time = 1\nd = (1\ne = 2\nv.w = 1";
    let found = faults(text);
    let lines: Vec<(usize, usize)> = found.iter().map(|(line, column, _)| (*line, *column)).collect();
    assert_eq!(lines, [(1, 8), (4, 5), (5, 2), (7, 1)]);
    assert_eq!(found[2].2, "`time` is reserved and cannot be assigned");
    assert_eq!(faults("a = 1\n\n$ = 1; é\n b = $").len(), 2);
    assert_eq!(faults(&"$\n".repeat(100_000)).len(), MAX_FAULTS);
    let widths = faults("b = 2\nP = 3\nv.w = 1\nlet x = P.x.x\na = vec(P)");
    let lines: Vec<usize> = widths.iter().map(|(line, ..)| *line).collect();
    assert_eq!(lines, [2, 3, 4, 5]);
}

#[test]
fn invalid_assignments_are_refused() {
    for (text, column, fact) in [
        ("P.x", 4, "expected `=`, found the end"),
        ("sin(1)", 4, "expected `=`, found `(`"),
        ("1 = a", 1, "expected the name of an attribute, found `1`"),
        ("a = 1 b = 2", 7, "expected an operator or the end of the line, found `b`"),
        ("sin = 1", 1, "`sin` is a function and cannot be assigned"),
        ("strength = 1", 1, "`strength` is a control and cannot be assigned"),
        ("let strength = 1", 5, "`strength` is a control and cannot be assigned"),
        ("let a = 1; a = 2", 12, "`a` is a `let` value and cannot be assigned"),
        ("let a.x = 1", 6, "expected `=`, found `.`"),
        ("let = 1", 5, "expected a name after `let`, found `=`"),
        ("a == 1", 3, "expected `=`, found `==`"),
        ("a = b = 1", 7, "expected an operator or the end of the line, found `=`"),
        ("P = 1", 1, "cannot assign a scalar to `P`, which is a 3-vector"),
        ("envelope = P", 1, "cannot assign a 3-vector to `envelope`, which is a scalar"),
        ("P.x = P", 1, "cannot assign a 3-vector to `P.x`, which is a scalar"),
        ("a = 1; a.x = 1", 8, "a scalar has no components"),
        ("a = orient*P", 11, "`*` cannot combine a 4-vector and a 3-vector"),
    ] {
        assert_eq!(faults(text), [(1, column, fact.to_owned())], "{text}");
    }
}

#[test]
fn faults_that_depend_on_the_columns_are_found_when_running() {
    let code = |text: &str, columns: &[(&str, &Column)]| match run(text, columns) {
        Err(RunError::Code(fault)) => fault,
        other => panic!("{text}: {other:?}"),
    };
    let (p, mask) = (f3(&[[0.0; 3]]), f1(&[1.0]));
    let columns = [("P", &p), ("mask", &mask)];
    let fault = code("a = 1\nb = msk*2", &columns);
    assert_eq!((fault.line, fault.column), (2, 5));
    assert_eq!(fault.fact, "there is no attribute, control or `let` value `msk`");
    assert_eq!(fault.hint.as_deref(), Some("did you mean `mask`?"));
    let fault = code("let height = 1; b = hieght", &columns);
    assert_eq!(fault.hint.as_deref(), Some("did you mean `height`?"));
    let fault = code("b = zebra", &columns);
    assert_eq!(fault.hint.as_deref(), Some("available: `P`, `mask`, `strength`, `wind`"));
    assert_eq!(code("b = mask.x", &columns).fact, "a scalar has no components");
    assert_eq!(code("mask = P", &columns).fact, "cannot assign a 3-vector to `mask`, which is a scalar");
    assert_eq!(code("v.x = 1", &columns).fact, "the attribute `v` does not exist yet");
    assert_eq!(code("a = envelope", &columns).fact, "there is no attribute, control or `let` value `envelope`");
}

#[test]
fn the_first_value_out_of_range_is_reported() {
    let value = |text: &str| match run_on_p(text) {
        Err(RunError::Value(bad)) => bad,
        other => panic!("{text}: {other:?}"),
    };
    let bad = value("a = 1\nP.y = 1/(P.x - 2)");
    assert_eq!((bad.attribute.as_str(), bad.element, bad.line), ("P.y", 1, 2));
    assert_eq!(bad.to_string(), "`P.y` would be inf, not a finite number");
    assert!(value("a = sqrt(2 - P.x)").value.is_nan());
    assert_eq!(value("a = P.x*1e38*2").element, 1);
    let bad = value("id = P.x*1e9");
    assert_eq!((bad.element, bad.value), (2, 3e9));
    assert_eq!(bad.to_string(), "`id` would be 3000000000, not a whole number from -2147483648 to 2147483647");
    assert_eq!(value("b = 0/0\na = 0/0").attribute, "b");
}

#[test]
fn a_value_that_is_overwritten_may_be_out_of_range() {
    check("a = 1/0\na = P.x", &[("a", f1(&[1.0, 2.0, 3.0]))]);
    check("a = P.x > 1 ? 1/(P.x - 1) : 0", &[("a", f1(&[0.0, 1.0, 0.5]))]);
}

#[test]
fn a_column_of_another_length_is_refused() {
    let (p, short) = (f3(&[[0.0; 3]; 3]), f1(&[1.0]));
    let found = run("a = P.x*w", &[("P", &p), ("w", &short)]);
    assert_eq!(found, Err(RunError::Rows { name: "w".to_owned(), rows: 1, expected: 3 }));
}

#[test]
fn errors_convert_to_those_of_a_node() {
    let bad = crate::Error::from(run_on_p("a = 1/(P.x - 1)").unwrap_err());
    assert_eq!(bad.kind, crate::ErrorKind::NotFinite);
    assert_eq!(bad.fact, "line 1, element 0: `a` would be inf, not a finite number");
    let code = crate::Error::from(run_on_p("a = tme").unwrap_err());
    assert_eq!(
        code.to_string(),
        "line 1, column 5: there is no attribute, control or `let` value `tme`; did you mean `time`?"
    );
}

#[test]
fn any_number_of_threads_gives_the_same_bits() {
    let rows = 20_011;
    let p: Vec<[f32; 3]> = (0..rows).map(|k| [k as f32 * 0.37, (k % 97) as f32, -1.5]).collect();
    let p = Column::new(p);
    let text = "a = sin(P.x*time) + noise(P*0.1) + rand(i, seed)\nP.y += a*strength; n = normalize(P)";
    let program = Program::parse(text, &SCOPE).unwrap();
    let results = [1, 2, 7].map(|threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| program.run(&ENV, &[("P", &p)], rows).unwrap())
    });
    assert_eq!(results[0], results[1]);
    assert_eq!(results[0], results[2]);
}

#[test]
fn the_reported_value_is_the_same_on_any_number_of_threads() {
    let rows = 50_000;
    let x = Column::new((0..rows).map(|k| k as f32).collect::<Vec<f32>>());
    let program = Program::parse("a = 1/(x - 40000)\nb = 1/(x - 12345)\nc = 0", &SCOPE).unwrap();
    for threads in [1, 2, 7] {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let Err(RunError::Value(bad)) = pool.install(|| program.run(&ENV, &[("x", &x)], rows)) else {
            panic!("the division by zero was not noticed");
        };
        assert_eq!((bad.attribute.as_str(), bad.element), ("a", 40_000));
    }
}
