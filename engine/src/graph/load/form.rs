//! The fault of an object that sets a value in none of the forms.

use crate::expr::suggest::nearest;
use crate::graph::fault::{Fault, code};
use crate::graph::json::{Entry, Json};

/// What users write for a form that has another name.
const OTHER_NAMES: [(&str, &str); 5] =
    [("keys", "keyframes"), ("key", "keyframes"), ("frames", "keyframes"), ("expression", "expr"), ("code", "expr")];

/// The fault of an object with none of the `forms` that it could have; a plain value would be `literal`.
pub(super) fn not_a_form(json: &Json<'_>, entries: &[Entry<'_>], literal: &str, forms: &[&str]) -> Fault {
    let fault = json.fault(code::PARAM_FORM, "the object does not set a value");
    let other = |name: &str| OTHER_NAMES.iter().find(|(other, form)| *other == name && forms.contains(form));
    let near = entries.iter().find_map(|entry| match other(entry.name) {
        Some((_, form)) => Some(*form),
        None => nearest(entry.name, forms.iter().copied()),
    });
    fault.hint(match near {
        Some(near) => format!("did you mean `{near}`?"),
        None => format!("expected {literal}, or an object with one of `{}`", forms.join("`, `")),
    })
}
