//! `new-node`: a node's file and its two lines in the family's list.

use std::fs;
use std::path::Path;

use crate::template::{Options, render};

/// Writes node `name` into `family`; returns a message with the next step.
///
/// # Errors
/// If a name is not allowed, the family is unknown, or the node exists already.
pub(crate) fn write(root: &Path, name: &str, family: &str, options: &Options) -> Result<String, String> {
    let module = module_name(name)?;
    for param in options.mask.iter().chain(&options.ramp) {
        check_param(param)?;
    }
    if options.mask.is_some() && options.mask == options.ramp {
        return Err(format!("both params are named `{}`", options.mask.as_deref().unwrap_or_default()));
    }
    let folder = root.join("nodes").join(family);
    let list = folder.join("lib.rs");
    let text = fs::read_to_string(&list)
        .map_err(|error| format!("there is no family `{family}`: `{}` could not be read: {error}", list.display()))?;
    let file = folder.join(format!("{module}.rs"));
    if file.exists() || folder.join(&module).exists() {
        return Err(format!("`{}` exists already", file.display()));
    }
    let text =
        with_module(&text, &module).ok_or_else(|| format!("`{}` has no list of modules to add to", list.display()))?;
    let written = fs::write(&file, render(name, options)).and_then(|()| fs::write(&list, text));
    written.map_err(|error| format!("`{}` could not be written: {error}", file.display()))?;
    Ok(format!("wrote nodes/{family}/{module}.rs and its lines in lib.rs; try: cargo test -p {family} {module}"))
}

/// `Curve_Wind` → `curve_wind`.
fn module_name(name: &str) -> Result<String, String> {
    let parts = || name.split('_');
    let word = |part: &str| {
        part.chars().next().is_some_and(|c| c.is_ascii_uppercase()) && part.chars().all(|c| c.is_ascii_alphanumeric())
    };
    match parts().all(word) {
        true => Ok(name.to_ascii_lowercase()),
        false => Err(format!("`{name}` is not a valid name of a node; write it like Curve_Smooth")),
    }
}

/// Names whose constants a node's file has already.
const TAKEN: [&str; 10] =
    ["curve_id", "curves", "inputs", "length_error", "metrics", "node", "out", "p", "params", "seed"];

fn check_param(name: &str) -> Result<(), String> {
    let fits = name.starts_with(|c: char| c.is_ascii_lowercase())
        && name.chars().all(|c| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '_');
    if TAKEN.contains(&name) {
        return Err(format!("the param cannot be named `{name}`, which the node's file uses for something else"));
    }
    if fits { Ok(()) } else { Err(format!("`{name}` is not a valid name of a param; write it like ramp_rotate")) }
}

/// The family's `lib.rs` with the module and its line in `NODES` added in order.
fn with_module(text: &str, module: &str) -> Option<String> {
    let text = inserted(text, &format!("mod {module};"), |line| line.starts_with("mod "))?;
    if text.contains("= &[\n") {
        return inserted(&text, &format!("    &{module}::NODE,"), |line| line.starts_with("    &"));
    }
    // A list on one line is first split into lines.
    let start = text.find("= &[")? + "= &[".len();
    let end = start + text[start..].find("];")?;
    let mut entries: Vec<String> =
        text[start..end].split(',').map(|entry| entry.trim().to_owned()).filter(|entry| !entry.is_empty()).collect();
    entries.push(format!("&{module}::NODE"));
    entries.sort();
    let lines: String = entries.iter().map(|entry| format!("    {entry},\n")).collect();
    Some(format!("{}\n{lines}{}", &text[..start], &text[end..]))
}

/// `text` with `line` inserted in order among the lines that are `like` it.
fn inserted(text: &str, line: &str, like: impl Fn(&str) -> bool) -> Option<String> {
    let lines: Vec<&str> = text.lines().collect();
    let last = lines.iter().rposition(|other| like(other))?;
    let at = lines.iter().position(|other| like(other) && *other > line).unwrap_or(last + 1);
    let mut all = lines;
    all.insert(at, line);
    Some(all.join("\n") + "\n")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_module_and_its_node_are_inserted_in_order() {
        let before = "//! F.\n\nmod a;\nmod c;\n\npub static NODES: &[&Node] = &[\n    &a::NODE,\n    &c::NODE,\n];\n";
        let after = "//! F.\n\nmod a;\nmod b;\nmod c;\n\npub static NODES: &[&Node] = &[\n    &a::NODE,\n    &b::NODE,\n    &c::NODE,\n];\n";
        assert_eq!(with_module(before, "b").unwrap(), after);
    }

    #[test]
    fn a_list_on_one_line_is_split() {
        let before = "mod a;\n\npub static NODES: &[&Node] = &[&a::NODE];\n";
        let after = "mod a;\nmod b;\n\npub static NODES: &[&Node] = &[\n    &a::NODE,\n    &b::NODE,\n];\n";
        assert_eq!(with_module(before, "b").unwrap(), after);
    }

    #[test]
    fn params_are_lower_case_words() {
        assert!(check_param("ramp_rotate").is_ok());
        assert!(check_param("curves").is_err_and(|fact| fact.contains("uses for something else")));
        assert!(["Ramp", "", "a b", "1st", "seed"].iter().all(|name| check_param(name).is_err()));
    }

    #[test]
    fn names_are_words_joined_by_underscores() {
        assert_eq!(module_name("Curve_Smooth").unwrap(), "curve_smooth");
        assert_eq!(module_name("FluidSolve").unwrap(), "fluidsolve");
        assert!(
            module_name("curve").is_err() && module_name("Curve_").is_err() && module_name("Curve Smooth").is_err()
        );
    }
}
