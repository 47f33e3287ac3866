//! Attribute_Expr: computes attributes from other attributes with a few lines of code.
//!
//! The language is that of [`engine::expr`]. Each row sees its own attributes, those with one row for the whole
//! component, and, on points of curves, also those of the curve. A missing well-known attribute has its neutral value
//! (`envelope` 1, `width` 0, `v` 0, `orient` no rotation, `Pref` the position), so that code runs on curves straight
//! from a file. `rand` and `noise` depend on `seed`, which is the node's seed mixed with the scene's.

use engine::expr::{Env, ExprError, Program, RunError};
use engine::prelude::*;

inputs! { INPUTS:
    GEOMETRY: Input = Input::any("geometry", "The geometry whose attributes are computed.");
}

choice! {
    /// The component that the code runs on.
    enum Part {
        Curves = "curves": "the curves",
        Mesh = "mesh": "the mesh",
        Points = "points": "the loose points",
        Tets = "tets": "the tets",
    }
}

choice! {
    /// The rows that the code runs on.
    enum Over {
        Points = "points": "every CV, vertex, particle or point of a tet",
        Elements = "elements": "every curve, face or tet",
    }
}

params! { PARAMS:
    CODE: Param<Code> = Param::code("code",
        "One assignment per line, such as `envelope = clamp(envelope*P.y, 0, 1)` or `P.y += 0.1*sin(time)`. Assigning \
         to a new name creates an attribute: a number or a vector, like the value. `let h = P.y*2` defines `h` for the \
         following lines only. Expressions can use attributes (components are `.x .y .z .w`), the graph's controls, \
         `frame`, `time` (seconds), `fps`, `seed`, `pi`, `i` (the index of the point or element, from 0) and `count` \
         (how many there are). Where an attribute has the same name as a control, write `@name` for the attribute. \
         Operators are `+ - * / % ^`, comparisons, `&& || !` and `a ? b : c`. Functions are sin cos tan asin acos atan \
         atan2 radians degrees sqrt exp log pow mod abs sign floor ceil round fract min max clamp mix step smoothstep \
         fit noise rand vec length distance dot cross normalize. `rand(i)` is a random number from 0 to 1 for each \
         point or element, `noise(P)` a smooth pattern. Angles are in radians. Empty code does nothing.");
    COMPONENT: Param<Part> = Param::choice("component", Part::Curves, "The component that the code runs on.");
    OVER: Param<Over> = Param::choice("over", Over::Points,
        "Whether the code runs once per point or once per element.");
    SEED: Param<Seed> = Param::seed("Each seed gives other values of `rand` and `noise`.");
}

const CHANGED: Output = Output::like("geometry", &GEOMETRY, "The geometry with the attributes that the code assigns.");

metrics! { METRICS:
    ROWS = Metric::new("rows", Unit::None, "Number of points or elements that the code ran on.");
}

pub(crate) static NODE: Node = Node::new(
    "Attribute_Expr",
    1,
    "Creates or changes attributes, positions included, by expressions evaluated for every point or element. An \
     expression can use the attributes of its point or element, those of the whole component and, for points of \
     curves, those of the curve. Missing well-known attributes have their neutral value: `envelope` 1, `width` and `v` \
     0.",
    Cook::Frame { cook, reads_clock },
)
.inputs(INPUTS)
.params(PARAMS)
.outputs(&[&CHANGED])
.attributes(attributes)
.metrics(METRICS)
.checks(|params| checked_program(&params.get(CODE), params).map(drop))
.neutral(|params, _| {
    let idle = program(&params.get(CODE)).is_ok_and(|program| program.writes().is_empty());
    idle.then_some("`code` assigns nothing")
});

/// The compiled code.
///
/// # Errors
/// The faults of all lines, with line and column, and the first hint.
fn program(code: &Code) -> Result<&Program> {
    code.program().map_err(|faults| {
        let place = |fault: &ExprError| format!("line {}, column {}: {}", fault.line, fault.column, fault.fact);
        let facts: Vec<String> = faults.iter().map(place).collect();
        let hint = faults.iter().find_map(|fault| fault.hint.clone());
        Error { hint, ..Error::refused(facts.join("; ")).of(CODE.name()) }
    })
}

/// The compiled code, if it can run on the chosen rows.
///
/// # Errors
/// Errors in the code, or a component that has no such rows.
fn checked_program<'c>(code: &'c Code, params: &Params) -> Result<&'c Program> {
    let program = program(code)?;
    let elements = params.get(OVER) == Over::Elements;
    let fact = match params.get(COMPONENT) {
        Part::Points if elements => "loose points have no elements",
        _ if elements && program.writes().iter().any(|name| name == P.name) => {
            "`P` belongs to points, and the code runs on elements"
        }
        _ => return Ok(program),
    };
    Err(Error::refused(fact).hint("set `over` to \"points\""))
}

/// The frame rate counts as the clock: it belongs to the scene, not to the params.
fn reads_clock(params: &Params) -> bool {
    program(&params.get(CODE)).is_ok_and(|program| program.uses().time || program.uses().fps)
}

/// Written attributes are read too: points and elements of other components may have an attribute of that name.
fn attributes(params: &Params) -> [AttrNames; 2] {
    let names = |lists: &[&[String]]| {
        AttrNames::These(lists.iter().flat_map(|list| list.iter()).map(|name| Name::from(name.as_str())).collect())
    };
    match program(&params.get(CODE)) {
        Ok(program) => [names(&[program.reads(), program.writes()]), names(&[program.writes()])],
        Err(_) => [names(&[]), names(&[])],
    }
}

fn cook(cx: &FrameCx) -> Result<Outputs> {
    let code = cx.get(CODE);
    let program = checked_program(&code, cx.params())?;
    let mut geometry = cx.input(GEOMETRY).clone();
    let part = part(&mut geometry, cx.get(COMPONENT))?;
    let owner = match cx.get(OVER) {
        Over::Points => Owner::Point,
        Over::Elements => Owner::Element,
    };
    cx.publish(ROWS, part.table(owner).rows() as f64);
    let env = env(cx, &code);
    // Where nobody takes what the code writes, only its faults count: it runs on no rows.
    if program.writes().iter().any(|name| *name == *P.name || cx.wants_named(name)) {
        for (name, column) in run(program, &env, part, owner, part.table(owner).rows())? {
            part.set_column(owner, name, column)?;
        }
    } else {
        run(program, &env, part, owner, 0)?;
    }
    Ok(CHANGED.with(geometry))
}

fn env<'c>(cx: &FrameCx, code: &'c Code) -> Env<'c> {
    let seed = f64::from(cx.get(SEED).0);
    Env { frame: cx.frame().number(), time: cx.seconds(), fps: cx.fps(), seed, controls: code.controls() }
}

fn part(geometry: &mut Geometry, component: Part) -> Result<&mut Component> {
    let kind = match component {
        Part::Curves => Kind::Curves,
        Part::Mesh => Kind::Mesh,
        Part::Points => Kind::Points,
        Part::Tets => Kind::Tets,
    };
    let there: Vec<&str> = geometry.kinds().map(Kind::name).collect();
    let hint =
        format!("set `component`; it has {}", if there.is_empty() { "nothing".into() } else { there.join(", ") });
    geometry.part_mut(kind).ok_or_else(|| Error::refused(format!("`geometry` has no {kind}")).hint(hint).of_types())
}

/// The columns that the code writes, run on the first `rows` rows.
fn run(program: &Program, env: &Env<'_>, part: &Component, owner: Owner, rows: usize) -> Result<Vec<(String, Column)>> {
    let table = part.table(owner);
    let lent: Vec<(&str, Column)> = program
        .reads()
        .iter()
        .filter(|name| table.column(name).is_none())
        .filter_map(|name| Some((name.as_str(), lent(part, owner, name)?)))
        .collect();
    for name in program.writes() {
        check_owner(part, owner, name)?;
    }
    let own = table.iter().map(|(name, column)| (&**name, column));
    let columns: Vec<(&str, &Column)> = own.chain(lent.iter().map(|(name, column)| (*name, column))).collect();
    if rows == table.rows() {
        return program.run(env, &columns, rows).map_err(|error| explained(error, part, owner));
    }
    let chosen: Vec<u32> = (0..rows as u32).collect();
    let cut: Vec<(&str, Column)> = columns.iter().map(|(name, column)| (*name, column.gather(&chosen))).collect();
    let columns: Vec<(&str, &Column)> = cut.iter().map(|(name, column)| (*name, column)).collect();
    program.run(env, &columns, rows).map_err(|error| explained(error, part, owner))
}

/// An attribute that rows of `owner` do not have themselves: taken from the whole component, from a CV's curve, or
/// neutral.
fn lent(part: &Component, owner: Owner, name: &str) -> Option<Column> {
    if let Some(column) = part.table(Owner::Once).column(name) {
        return Some(column.gather(&vec![0; part.table(owner).rows()]));
    }
    match (part.topology(), part.table(other(owner)).column(name)) {
        (Topology::Curves(runs), Some(column)) if owner == Owner::Point => {
            let curves = runs.counts().enumerate();
            let rows: Vec<u32> = curves.flat_map(|(k, cvs)| std::iter::repeat_n(k as u32, cvs as usize)).collect();
            Some(column.gather(&rows))
        }
        (_, Some(_)) => None,
        (_, None) => part.neutral(owner, name),
    }
}

fn other(owner: Owner) -> Owner {
    if owner == Owner::Point { Owner::Element } else { Owner::Point }
}

/// Refuses to write an attribute that the other kind of row has: two attributes with one name would diverge.
fn check_owner(part: &Component, owner: Owner, name: &str) -> Result<()> {
    let theirs = other(owner);
    if part.table(owner).column(name).is_none() && part.table(theirs).column(name).is_some() {
        let fact = format!("`{name}` of the {} belongs to {theirs}s, and the code runs on {owner}s", part.kind());
        let hint = format!("set `over` to \"{theirs}s\", or assign to another name");
        return Err(Error::refused(fact).hint(hint).of(CODE.name()).of_types());
    }
    Ok(())
}

/// The error, with a hint if the code names an attribute of the other kind of row.
fn explained(error: RunError, part: &Component, owner: Owner) -> Error {
    let RunError::Code(fault) = &error else { return Error::from(error).of(CODE.name()) };
    let theirs = part.table(other(owner));
    let named = theirs.iter().map(|(name, _)| name).find(|name| fault.fact.contains(&format!("`{name}`")));
    let hint = named.map(|name| match owner {
        Owner::Point => format!("`{name}` belongs to elements, and a point of the {} may lie in several", part.kind()),
        _ => format!("`{name}` belongs to points, of which an element has several; set `over` to \"points\""),
    });
    let error = Error::from(error).of(CODE.name());
    Error { hint: hint.or(error.hint), ..error }
}

#[cfg(test)]
mod tests {
    use super::*;
    use conformance::{Bench, BenchResult, bench, conformance, cook_all};
    use engine::cook::{Engine, Settings};
    use engine::graph::{Catalogue, Graph, probe};

    fn curves() -> Component {
        let points = vec![[0.0, 0.5, 0.0], [0.0, 2.0, 0.0], [3.0, 1.0, 0.0]];
        let mut curves = Component::curves(vec![2, 1], points).unwrap();
        curves.set(SHIELDED, vec![0.25, 0.75]).unwrap();
        curves
    }

    fn code(text: &str) -> Bench {
        bench(&NODE).input(GEOMETRY, curves()).set(CODE, text.into())
    }

    fn floats<'a>(out: &'a BenchResult, name: &'static str) -> &'a [f32] {
        out.curves().get(Attr::point(name)).unwrap()
    }

    fn refused(bench: &Bench) -> String {
        bench.try_cook().unwrap_err().to_string()
    }

    #[test]
    fn the_example_in_the_help_runs_on_curves_without_attributes() {
        let out = code("envelope = clamp(envelope*P.y, 0, 1)").cook();
        assert_eq!(out.curves().get(ENVELOPE), Some(&[0.5, 1.0, 1.0][..]));
        assert_eq!(out.metrics["rows"], 3.0);
    }

    #[test]
    fn positions_can_be_written_and_other_arrays_are_shared() {
        let input = curves();
        let out = bench(&NODE).input(GEOMETRY, input.clone()).set(CODE, "P.y *= 2; P.x = i".into()).cook();
        assert_eq!(out.curves().positions(), [[0.0, 1.0, 0.0], [1.0, 4.0, 0.0], [2.0, 2.0, 0.0]]);
        assert!(out.curves().topology().same(input.topology()));
        let shielded = |curves: &Component| curves.table(Owner::Element).column("shielded").unwrap().address();
        assert_eq!(shielded(out.curves()), shielded(&input));
    }

    #[test]
    fn code_whose_results_nobody_takes_does_not_run_on_rows_but_its_faults_are_found() {
        let cook = |code: &str, wanted: &str| {
            let text = format!(
                r#"{{ "convect": 1, "outputs": {{ "out": {{ "from": "node", "attributes": [{wanted}] }} }}, "nodes": {{
                    "curves": {{ "type": "Curve_In", "params": {{ "points": [[0, 1, 0], [0, 2, 0]] }} }},
                    "node": {{ "type": "Attribute_Expr", "inputs": {{ "geometry": "curves" }}, "params": {{ "code": "{code}" }} }} }} }}"#
            );
            static FAMILIES: [&[&Node]; 1] = [crate::NODES];
            let catalogue = Catalogue(&FAMILIES);
            let graph = Graph::load(&text, std::path::Path::new("."), catalogue, &[], &probe).unwrap();
            let engine = Engine::new(&Settings::default()).unwrap();
            let (found, report) = cook_all(&engine, &graph, &[Frame::whole(1)]);
            (found.into_values().next(), report.errors.first().map(|(_, error, _)| error.to_string()))
        };
        // A value that is not finite is found where the code runs on it.
        assert!(cook("heat = 1/(P.y - 1)", "\"P\", \"heat\"").1.unwrap().contains("heat"));
        let (unused, error) = cook("heat = 1/(P.y - 1)", "\"P\"");
        assert!(error.is_none() && unused.unwrap().curves().unwrap().point_count() == 2);
        assert!(cook("heat = nothing", "\"P\"").1.unwrap().contains("nothing"));
        // Positions are always taken.
        assert_eq!(cook("P.y = 3; heat = 1", "\"P\"").0.unwrap().curves().unwrap().positions(), [[0.0, 3.0, 0.0]; 2]);
    }

    #[test]
    fn code_without_assignments_shares_every_array() {
        let input = Geometry::from(curves());
        for text in ["", "// nothing", "let a = P.x"] {
            let out = bench(&NODE).input(GEOMETRY, input.clone()).set(CODE, text.into()).cook();
            assert_eq!(out.geometry.arrays(), input.arrays());
        }
    }

    #[test]
    fn a_cv_can_read_attributes_of_its_curve_and_of_the_component() {
        let mut input = curves();
        input.set(Attr::<f32>::once("gain"), vec![10.0]).unwrap();
        let out = bench(&NODE).input(GEOMETRY, input).set(CODE, "a = shielded*gain".into()).cook();
        assert_eq!(floats(&out, "a"), [2.5, 2.5, 7.5]);
    }

    #[test]
    fn missing_well_known_attributes_are_neutral() {
        let out = code("a = width + v.x + shielded*0 + orient.w + (Pref.y - P.y) + thickness").cook();
        assert_eq!(floats(&out, "a"), [1.0; 3]);
    }

    #[test]
    fn elements_have_their_own_attributes() {
        let out = code("shielded = 1 - shielded; k = i").set(OVER, Over::Elements).cook();
        assert_eq!(out.curves().get(SHIELDED), Some(&[0.75, 0.25][..]));
        assert_eq!(out.curves().get(Attr::<f32>::element("k")), Some(&[0.0, 1.0][..]));
    }

    #[test]
    fn time_and_frame_are_those_of_the_cook() {
        let moving = code("a = time*24; b = frame");
        for frame in [1.0, 2.5, 40.0] {
            let out = moving.clone().at(frame).cook();
            assert_eq!(floats(&out, "a"), [frame as f32; 3]);
            assert_eq!(floats(&out, "b"), [frame as f32; 3]);
        }
    }

    #[test]
    fn the_seed_changes_random_numbers_only() {
        let random = |seed| floats(&code("a = rand(i)").set(SEED, Seed(seed)).cook(), "a").to_vec();
        assert_eq!(random(1), random(1));
        assert_ne!(random(1), random(2));
        assert_ne!(random(1)[0].to_bits(), random(1)[1].to_bits());
    }

    #[test]
    fn code_that_does_not_name_the_clock_runs_once() {
        let cooks = |text: &str| {
            let engine = Engine::new(&Settings::default()).unwrap();
            let frames: Vec<Frame> = (1..=5).map(Frame::whole).collect();
            let (_, report) = cook_all(&engine, &code(text).graph(), &frames);
            report.nodes.last().unwrap().cooks
        };
        assert_eq!(cooks("a = P.x + rand(i)"), 1);
        assert_eq!(cooks("a = time"), 5);
        assert_eq!(cooks("a = fps"), 5);
    }

    #[test]
    fn code_runs_on_the_points_of_any_component() {
        let mesh = Component::mesh(vec![3], vec![0, 1, 2], vec![[1.0; 3]; 3]).unwrap();
        let tets = Component::tets(vec![[0, 1, 2, 3]], vec![[1.0; 3]; 4]).unwrap();
        let all = Geometry::from(curves()).with(mesh).with(tets).with(Component::points(vec![[1.0; 3]]));
        for (component, kind) in [
            (Part::Curves, Kind::Curves),
            (Part::Mesh, Kind::Mesh),
            (Part::Points, Kind::Points),
            (Part::Tets, Kind::Tets),
        ] {
            let out =
                bench(&NODE).input(GEOMETRY, all.clone()).set(CODE, "a = 1".into()).set(COMPONENT, component).cook();
            for other in [Kind::Curves, Kind::Mesh, Kind::Points, Kind::Tets] {
                let written = out.part(other).table(Owner::Point).column("a").is_some();
                assert_eq!(written, other == kind);
            }
        }
    }

    #[test]
    fn faults_of_the_code_have_line_and_column() {
        assert_eq!(refused(&code("a = 1\nb = sin(")), "line 2, column 9: expected a value, found the end");
        assert_eq!(
            refused(&code("a = envelop")),
            "line 1, column 5: there is no attribute, control or `let` value `envelop`; available: `P`"
        );
        assert_eq!(refused(&code("a = 1/(P.x - 3)")), "line 1, element 2: `a` would be inf, not a finite number");
        let two = refused(&code("a = clamp(1)\nb = 2\nc = 3 +"));
        assert!(two.starts_with("line 1, column 5: ") && two.contains("; line 3, column 8: "), "{two}");
    }

    #[test]
    fn attributes_of_the_other_kind_of_row_are_refused_by_name() {
        assert_eq!(
            refused(&code("a = P.x").set(OVER, Over::Elements)),
            "line 1, column 5: there is no attribute, control or `let` value `P`; \
             `P` belongs to points, of which an element has several; set `over` to \"points\""
        );
        assert_eq!(
            refused(&code("shielded = 1")),
            "`shielded` of the curves belongs to elements, and the code runs on points; \
             set `over` to \"elements\", or assign to another name"
        );
        let mut mesh = Component::mesh(vec![3], vec![0, 1, 2], vec![[1.0; 3]; 3]).unwrap();
        mesh.set(Attr::<f32>::element("mask"), vec![1.0]).unwrap();
        let mesh = bench(&NODE).input(GEOMETRY, mesh).set(COMPONENT, Part::Mesh).set(CODE, "a = mask".into());
        assert!(refused(&mesh).ends_with("`mask` belongs to elements, and a point of the mesh may lie in several"));
    }

    #[test]
    fn impossible_params_are_refused_before_the_cook() {
        let loose = code("a = 1").set(COMPONENT, Part::Points).set(OVER, Over::Elements);
        assert_eq!(refused(&loose), "loose points have no elements; set `over` to \"points\"");
        let positions = code("P = P*2").set(OVER, Over::Elements);
        assert_eq!(
            refused(&positions),
            "`P` belongs to points, and the code runs on elements; set `over` to \"points\""
        );
        let absent = code("a = 1").set(COMPONENT, Part::Tets);
        assert_eq!(refused(&absent), "`geometry` has no tets; set `component`; it has curves");
    }

    #[test]
    fn empty_components_and_any_number_of_threads_work() {
        let empty = Component::curves(vec![], vec![]).unwrap();
        let out = bench(&NODE).input(GEOMETRY, empty).set(CODE, "a = P.x".into()).cook();
        assert_eq!(floats(&out, "a"), [0.0; 0]);
        let points: Vec<[f32; 3]> = (0..9_999).map(|k| [k as f32, 0.5, -1.0]).collect();
        let many = bench(&NODE).input(GEOMETRY, Component::curves(vec![9_999], points).unwrap());
        let many = many.set(CODE, "a = noise(P*0.1) + sin(P.x)".into());
        assert_eq!(many.clone().threads(1).cook().geometry, many.threads(7).cook().geometry);
    }

    #[test]
    fn it_conforms() {
        let code = |text: &'static str| move |bench: Bench| bench.set(CODE, text.into());
        conformance(&NODE).with(code("a = i + rand(i)")).with(code("b = time")).run();
    }
}
