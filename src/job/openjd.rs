//! A job as a template of Open Job Description, 2023-09. It is JSON, which is YAML too.

use serde_json::{Value, json};

use super::{Job, Placeholders};

pub(super) fn text(job: &Job) -> String {
    let wedge = job.wedges.as_ref().map(|_| "{{Task.Param.Wedge}}");
    let out = wedge.map_or_else(|| "{{Param.Out}}".to_owned(), |value| job.wedge_folder("{{Param.Out}}", value));
    let places = Placeholders { graph: "{{Param.Graph}}", out: &out, cache: "{{Param.Cache}}", wedge };
    let wedges = job.wedges.as_ref().map(|wedges| json!({"name": "Wedge", "type": "STRING", "range": wedges.values}));
    let mut steps: Vec<Value> = Vec::new();
    for step in &job.cut.steps {
        let part = json!({"name": "Part", "type": "STRING", "range": step.labels()});
        let parameters: Vec<Value> = [Some(part), wedges.clone()].into_iter().flatten().collect();
        let mut made = script(&step.name, job.cook(step, "{{Task.Param.Part}}", &places));
        made["parameterSpace"] = json!({"taskParameterDefinitions": parameters});
        if let Some(before) = step.after {
            made["dependencies"] = json!([{"dependsOn": job.cut.steps[before].name}]);
        }
        steps.push(made);
    }
    let names: Vec<Value> = job.cut.steps.iter().map(|step| json!({"dependsOn": step.name})).collect();
    let mut merge = script("merge", job.merge(&places));
    if !names.is_empty() {
        merge["dependencies"] = json!(names);
    }
    if let Some(wedges) = wedges {
        merge["parameterSpace"] = json!({"taskParameterDefinitions": [wedges]});
    }
    steps.push(merge);
    let path = |name: &str, object: &str, flow: &str| json!({"name": name, "type": "PATH", "objectType": object, "dataFlow": flow});
    let with_default = |mut parameter: Value, default: &str| {
        parameter["default"] = json!(default);
        parameter
    };
    let template = json!({
        "specificationVersion": "jobtemplate-2023-09",
        "name": job.name,
        "description": "Exit codes 0, 2, 3 and 4 of a task are final; 1, 130 and signals are worth a retry, which goes on from \
            the cache.",
        "parameterDefinitions": [
            path("Graph", "FILE", "IN"),
            with_default(path("Out", "DIRECTORY", "OUT"), "out"),
            with_default(path("Cache", "DIRECTORY", "INOUT"), "cache"),
            {"name": "Convect", "type": "STRING", "default": "convect"},
        ],
        "steps": steps,
    });
    serde_json::to_string_pretty(&template).unwrap_or_default() + "\n"
}

/// A step that runs the program.
fn script(name: &str, args: Vec<String>) -> Value {
    json!({
        "name": name,
        "script": {"actions": {"onRun": {
            "command": "{{Param.Convect}}",
            "args": args,
            "cancelation": {"mode": "NOTIFY_THEN_TERMINATE", "notifyPeriodInSeconds": 30},
        }}},
    })
}
