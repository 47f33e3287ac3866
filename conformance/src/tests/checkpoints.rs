//! A solver's checkpoint holds its whole state.

use super::*;

/// A solver: curves that fall, faster and faster.
#[derive(Serialize, Deserialize)]
pub(super) struct Fall {
    points: Vec<[f32; 3]>,
    speed: f64,
}

impl Chain for Fall {
    fn start(cx: &FrameCx) -> Result<Self> {
        Ok(Self { points: cx.at_start(DROPPED).curves().map_or(&[][..], Component::positions).to_vec(), speed: 0.0 })
    }
    fn step(&mut self, cx: &StepCx) -> Result<()> {
        self.speed += f64::from(cx.get(AMOUNT)) * cx.dt();
        self.points.iter_mut().for_each(|p| p[1] -= (self.speed * cx.dt()) as f32);
        Ok(())
    }
    fn output(&self, _: &FrameCx) -> Result<Outputs> {
        Ok(FALLEN.with(Geometry::from(Component::points(self.points.clone()))))
    }
}

/// The same, with a speed that is not in the checkpoint.
#[derive(Serialize, Deserialize)]
struct Forgetful {
    points: Vec<[f32; 3]>,
    #[serde(skip)]
    speed: f64,
}

impl Chain for Forgetful {
    fn start(cx: &FrameCx) -> Result<Self> {
        Fall::start(cx).map(|fall| Self { points: fall.points, speed: fall.speed })
    }
    fn step(&mut self, cx: &StepCx) -> Result<()> {
        let mut fall = Fall { points: std::mem::take(&mut self.points), speed: self.speed };
        fall.step(cx)?;
        (self.points, self.speed) = (fall.points, fall.speed);
        Ok(())
    }
    fn output(&self, cx: &FrameCx) -> Result<Outputs> {
        Fall { points: self.points.clone(), speed: self.speed }.output(cx)
    }
}

const DROPPED: Input = Input::one("curves", Kind::Curves, "Where they fall from.").read_at(|_| Times::START);
const FALLEN: Output = Output::new("points", &[Kind::Points], "The CVs, fallen.");

pub(super) fn falling() -> Node {
    Node::new("Fall", 1, "Curves that fall.", Cook::solver::<Fall>(|_| None))
        .inputs(&[&DROPPED])
        .params(&[&AMOUNT])
        .outputs(&[&FALLEN])
        .reads(&[&P])
}

#[test]
fn incomplete_checkpoints_are_found() {
    assert_eq!(findings_of(falling()), [""; 0]);
    let forgetful = Node { cook: Cook::solver::<Forgetful>(|_| None), ..falling() };
    finds_only(forgetful, "its state loses something when it is written to a checkpoint and read back");
}
