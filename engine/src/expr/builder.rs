//! Builds code, with common subexpressions merged, constants folded and unused values removed.
//!
//! Promise: equal instructions occur once, constants are folded by the same code that runs instructions, values that no
//! output needs are left out, and values that are the same for all elements come first. Limit: only constants are
//! folded; `x*0` is kept, because x may be infinite.

use std::collections::BTreeMap;

use super::code::{Binary, Code, Id, Input, Inst, Unary};

/// Collects instructions, merging equal ones and folding constants.
#[derive(Default)]
pub(super) struct Builder {
    insts: Vec<Inst>,
    ids: BTreeMap<Inst, Id>,
}

impl Builder {
    pub(super) fn len(&self) -> usize {
        self.insts.len()
    }

    pub(super) fn constant(&mut self, value: f64) -> Id {
        self.emit(Inst::Constant(value.to_bits()))
    }

    pub(super) fn input(&mut self, input: Input) -> Id {
        self.emit(Inst::Input(input))
    }

    pub(super) fn unary(&mut self, op: Unary, a: Id) -> Id {
        self.emit(Inst::Unary(op, a))
    }

    pub(super) fn binary(&mut self, op: Binary, a: Id, b: Id) -> Id {
        self.emit(Inst::Binary(op, a, b))
    }

    pub(super) fn select(&mut self, condition: Id, yes: Id, no: Id) -> Id {
        self.emit(Inst::Select(condition, yes, no))
    }

    pub(super) fn noise(&mut self, at: [Id; 3]) -> Id {
        self.emit(Inst::Noise(at[0], at[1], at[2]))
    }

    pub(super) fn random(&mut self, a: Id, b: Id) -> Id {
        self.emit(Inst::Random(a, b))
    }

    fn emit(&mut self, inst: Inst) -> Id {
        if let Some(id) = self.shortcut(inst) {
            return id;
        }
        let inst = self.folded(inst).map_or(inst, |value| Inst::Constant(value.to_bits()));
        *self.ids.entry(inst).or_insert_with(|| {
            self.insts.push(inst);
            (self.insts.len() - 1) as Id
        })
    }

    fn value(&self, id: Id) -> Option<f64> {
        match self.insts[id as usize] {
            Inst::Constant(bits) => Some(f64::from_bits(bits)),
            _ => None,
        }
    }

    /// The result of a selection or logical operator that a constant operand determines.
    fn shortcut(&mut self, inst: Inst) -> Option<Id> {
        match inst {
            Inst::Select(condition, yes, no) => self.value(condition).map(|c| if c != 0.0 { yes } else { no }),
            Inst::Binary(Binary::And, a, b) if [a, b].map(|id| self.value(id)).contains(&Some(0.0)) => {
                Some(self.constant(0.0))
            }
            Inst::Binary(Binary::Or, a, b) if [a, b].iter().any(|id| self.value(*id).is_some_and(|v| v != 0.0)) => {
                Some(self.constant(1.0))
            }
            _ => None,
        }
    }

    /// The result of an instruction with constant operands; noise and random numbers need the seed, so they are not
    /// folded.
    fn folded(&self, inst: Inst) -> Option<f64> {
        let mut out = [0.0];
        match inst {
            Inst::Unary(op, a) => op.run(&[self.value(a)?], &mut out),
            Inst::Binary(op, a, b) => op.run(&[self.value(a)?], &[self.value(b)?], &mut out),
            _ => return None,
        }
        Some(out[0])
    }

    /// The code that computes `outputs` and nothing else, uniform values first; and the outputs' ids in it.
    pub(super) fn finish(self, outputs: &[Id]) -> (Code, Vec<Id>) {
        let mut needed = vec![false; self.insts.len()];
        for id in outputs {
            needed[*id as usize] = true;
        }
        for (k, inst) in self.insts.iter().enumerate().rev() {
            if needed[k] {
                inst.operands().for_each(|id| needed[id as usize] = true);
            }
        }

        let mut uniform: Vec<bool> = Vec::with_capacity(self.insts.len());
        for inst in &self.insts {
            uniform.push(match inst {
                Inst::Input(input) => input.is_uniform(),
                _ => inst.operands().all(|id| uniform[id as usize]),
            });
        }

        let mut insts = Vec::new();
        let mut split = 0;
        let mut names = vec![0; self.insts.len()];
        for first in [true, false] {
            for (k, inst) in self.insts.iter().enumerate() {
                if needed[k] && uniform[k] == first {
                    names[k] = insts.len() as Id;
                    insts.push(inst.renamed(&names));
                }
            }
            if first {
                split = insts.len();
            }
        }
        (Code::new(insts, split), outputs.iter().map(|id| names[*id as usize]).collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn equal_instructions_are_merged_and_constants_folded() {
        let mut builder = Builder::default();
        let time = builder.input(Input::Time);
        let (two, three) = (builder.constant(2.0), builder.constant(3.0));
        let six = builder.binary(Binary::Multiply, two, three);
        assert_eq!(builder.value(six), Some(6.0));
        let sum = builder.binary(Binary::Add, time, six);
        let same = builder.binary(Binary::Add, time, six);
        assert_eq!(sum, same);
        let (code, outputs) = builder.finish(&[sum]);
        assert_eq!((code.len(), outputs), (3, vec![2]));
    }

    #[test]
    fn the_branch_not_taken_is_not_in_the_code() {
        let mut builder = Builder::default();
        let (time, index) = (builder.input(Input::Time), builder.input(Input::Index));
        let one = builder.constant(1.0);
        let chosen = builder.select(one, time, index);
        let (code, _) = builder.finish(&[chosen]);
        assert_eq!(code.inputs().collect::<Vec<_>>(), [Input::Time]);
    }

    #[test]
    fn uniform_values_come_first() {
        let mut builder = Builder::default();
        let index = builder.input(Input::Index);
        let time = builder.input(Input::Time);
        let wave = builder.unary(Unary::Sin, time);
        let product = builder.binary(Binary::Multiply, index, wave);
        let (code, outputs) = builder.finish(&[product]);
        assert_eq!((code.uniform(), code.len()), (2, 4));

        let mut values = [[0.0; 4]; 4];
        code.run(&mut values, 0, 0.0, |input, out| {
            *out = if input == Input::Index { [0.0, 1.0, 2.0, 3.0] } else { [0.5; 4] }
        });
        let wave = libm::sin(0.5);
        assert_eq!(values[outputs[0] as usize], [0.0, wave, 2.0 * wave, 3.0 * wave]);
    }
}
