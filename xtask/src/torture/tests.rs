//! A torture finds what a program does wrong, and nothing wrong with convect.

use serde_json::json;

use super::*;

/// A folder that is removed with it.
struct Scratch(PathBuf);

impl Scratch {
    fn new(name: &str) -> Self {
        let path = std::env::temp_dir().join(format!("convect-torture-{name}-{}", std::process::id()));
        fs::create_dir_all(&path).unwrap();
        Self(path)
    }
}

impl Drop for Scratch {
    fn drop(&mut self) {
        let _ = fs::remove_dir_all(&self.0);
    }
}

/// Tortures a shell script with one call, and says what it found.
fn found_in(name: &str, script: &str) -> Option<String> {
    let scratch = Scratch::new(name);
    let program = scratch.0.join("program");
    fs::write(&program, format!("#!/bin/sh\n{script}\n")).unwrap();
    assert!(Command::new("chmod").arg("+x").arg(&program).status().unwrap().success());
    let patience = Patience { asks: Duration::from_millis(100), hangs: Duration::from_millis(300) };
    let stock = Stock { graphs: Vec::new(), files: Vec::new(), types: Vec::new() };
    let torture = Torture { program, stock, folder: scratch.0.clone(), patience, tally: Tally::default() };
    let call = Call { args: vec!["cook".into(), "g.json".into()], ..Call::default() };
    let case = Case {
        kind: "graph",
        files: vec![("g.json".into(), b"{}".to_vec())],
        links: Vec::new(),
        pipes: Vec::new(),
        steps: vec![Step::Calls(vec![call])],
    };
    let (mut torture, folder) = (torture, scratch.0.join("case"));
    set_up(&case, &folder).unwrap();
    torture.steps(&case, &folder).unwrap().map(|(found, _)| found)
}

#[test]
fn a_program_that_does_nothing_wrong_passes() {
    assert_eq!(found_in("good", "mkdir out; echo '{}' > out/a.json; exit 4"), None);
}

#[test]
fn wrong_programs_are_found_out() {
    let found = |name: &str, script: &str| found_in(name, script).unwrap_or_default();
    assert!(found("lost", "rm g.json").starts_with("`g.json` is lost"));
    assert!(found("abort", "kill -ABRT $$").starts_with("ended by SIGABRT"));
    assert!(found("panic", "echo it panicked >&2; exit 4").starts_with("stderr says `panicked`"));
    assert!(found("left", "mkdir out; touch out/.a.json.tmp-1").contains("temporary `out/.a.json.tmp-1` is left"));
    assert!(found("half", "mkdir out; echo '{' > out/a.json").starts_with("`out/a.json` is not complete"));
    assert!(
        found("half_obj", "[ $1 = stats ] && exit 1; mkdir out; echo v > out/a.obj").starts_with("`out/a.obj` is not")
    );
}

#[test]
fn only_a_program_that_ignores_sigterm_hangs() {
    assert_eq!(found_in("slow", "exec sleep 20"), None);
    assert!(found_in("hangs", "trap '' TERM; exec sleep 20").unwrap().starts_with("it hangs"));
}

#[test]
fn folders_are_compared_by_bits() {
    let scratch = Scratch::new("compared");
    for (path, text) in [("a/x", "1"), ("b/x", "1")] {
        fs::create_dir_all(scratch.0.join(path).parent().unwrap()).unwrap();
        fs::write(scratch.0.join(path), text).unwrap();
    }
    assert_eq!(judge::difference(&scratch.0.join("a"), &scratch.0.join("b")), None);
    fs::write(scratch.0.join("b/x"), "3").unwrap();
    assert!(judge::difference(&scratch.0.join("a"), &scratch.0.join("b")).is_some());
}

#[test]
fn stored_seeds_have_comments() {
    assert_eq!(stored_seeds("# all\n7 # a panic\n\n18446744073709551615\n"), Ok(vec![7, u64::MAX]));
    assert!(stored_seeds("seven").is_err());
    let stored = fs::read_to_string(crate::root().join("xtask/torture_seeds.txt")).unwrap();
    assert!(stored_seeds(&stored).is_ok());
}

#[test]
fn calls_are_shown_as_they_can_be_repeated() {
    let call =
        Call { args: vec!["cook".into(), "a b".into()], blocks: Some(3), signal: Some(("INT", 5)), ..Call::default() };
    assert_eq!(shown(&call), "ulimit -f 3; convect cook 'a b'  # SIGINT after 5 ms");
}

/// The program that `cargo test --workspace` has built, or one that is built now.
fn convect() -> PathBuf {
    let beside = std::env::current_exe().unwrap().parent().unwrap().parent().unwrap().join("convect");
    if !beside.is_file() {
        let mut cargo = Command::new(env!("CARGO"));
        cargo.args(["build", "--quiet", "--bin", "convect"]).current_dir(crate::root());
        assert!(cargo.status().unwrap().success());
        return crate::root().join("target/debug/convect");
    }
    beside
}

#[test]
fn five_cases_of_the_examples_pass() {
    let scratch = Scratch::new("examples");
    let program = convect();
    let stock = Stock::load(&crate::root(), &program).unwrap();
    assert!(stock.types.iter().any(|one| one.name == "Merge" && one.inputs[0].is_list));
    assert!(stock.graphs.iter().any(|graph| graph["scene"]["frames"] == json!([1, 2])));
    let mut torture =
        Torture { program, stock, folder: scratch.0.clone(), patience: PATIENCE, tally: Tally::default() };
    for seed in 1..=5 {
        torture.case(seed, false).unwrap();
    }
    torture.tally.verdict().unwrap();
    assert_eq!(fs::read_dir(&scratch.0).unwrap().count(), 0, "folders of cases that pass are removed");
}
