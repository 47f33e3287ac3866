//! A job as shell commands, one a line: those that cook may run in any order, those that merge come last, one for each wedge. A
//! line that starts with # says where another order costs time.

use super::{Job, Placeholders, quoted};

pub(super) fn text(job: &Job) -> String {
    let out = job.out.display().to_string();
    let cache = format!("{out}/cache");
    let graph = job.graph.display().to_string();
    let values: Vec<Option<&str>> = match &job.wedges {
        Some(wedges) => wedges.values.iter().map(|value| Some(&**value)).collect(),
        None => vec![None],
    };
    let line = |args: Vec<String>| {
        let words: Vec<String> = args.iter().map(|word| quoted(word)).collect();
        format!("convect {}\n", words.join(" "))
    };
    let (mut cooks, mut merges) = (String::new(), String::new());
    for wedge in values {
        let folder = wedge.map_or_else(|| out.clone(), |value| job.wedge_folder(&out, value));
        let places = Placeholders { graph: &graph, out: &folder, cache: &cache, wedge };
        for step in &job.cut.steps {
            if let Some(before) = step.after {
                cooks += &format!(
                    "# these find in the cache what step {} cooked; before its end they cook it themselves\n",
                    job.cut.steps[before].name
                );
            }
            step.labels().iter().for_each(|part| cooks += &line(job.cook(step, part, &places)));
        }
        merges += &line(job.merge(&places));
    }
    cooks + &merges
}
