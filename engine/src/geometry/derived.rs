//! Values computed from a component's topology and positions and cached with them, such as a mesh's tree.
//!
//! Promise: shared by all clones of a component until the positions of one change; ignored when components are
//! compared. Limit: its memory is not counted in [`super::Geometry::bytes`].

use std::any::Any;
use std::sync::{Arc, Mutex, PoisonError};

/// At most one value of each type.
#[derive(Clone, Default)]
pub(super) struct Derived(Arc<Mutex<Vec<Arc<dyn Any + Send + Sync>>>>);

impl Derived {
    /// The value of type `T`, computed if it is absent. No lock is held while computing: a thread that waits for work
    /// of its own pool could deadlock. If several threads compute a value, all get the one stored first.
    pub(super) fn get_or<T: Send + Sync + 'static>(&self, compute: impl FnOnce() -> T) -> Arc<T> {
        if let Some(value) = self.find() {
            return value;
        }
        let computed = Arc::new(compute());
        let mut values = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        match first::<T>(&values) {
            Some(value) => value,
            None => {
                values.push(computed.clone());
                computed
            }
        }
    }

    fn find<T: Send + Sync + 'static>(&self) -> Option<Arc<T>> {
        first(&self.0.lock().unwrap_or_else(PoisonError::into_inner))
    }
}

fn first<T: Send + Sync + 'static>(values: &[Arc<dyn Any + Send + Sync>]) -> Option<Arc<T>> {
    values.iter().find_map(|value| value.clone().downcast().ok())
}

impl PartialEq for Derived {
    fn eq(&self, _: &Self) -> bool {
        true
    }
}

impl std::fmt::Debug for Derived {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("Derived")
    }
}

#[cfg(test)]
mod tests {
    use crate::geometry::{Attr, Component, ENVELOPE, P};

    struct Highest(f32);

    fn highest(part: &Component) -> f32 {
        part.derived(|part| Highest(part.positions().iter().map(|p| p[1]).fold(f32::MIN, f32::max))).0
    }

    #[test]
    fn it_is_computed_once_and_shared_until_positions_change() {
        let mut part = Component::curves(vec![2], vec![[0.0; 3], [0.0, 2.0, 0.0]]).unwrap();
        assert_eq!(highest(&part), 2.0);
        let mut clone = part.clone();
        clone.set(ENVELOPE, vec![0.0; 2]).unwrap();
        clone.derived::<Highest>(|_| panic!("it is cached"));
        clone.edit(P).unwrap()[1][1] = 3.0;
        assert_eq!((highest(&clone), highest(&part)), (3.0, 2.0));
        part.set(P, vec![[0.0; 3], [0.0, 5.0, 0.0]]).unwrap();
        part.set(Attr::<f32>::element("P"), vec![1.0]).unwrap_err();
        assert_eq!(highest(&part), 5.0);
    }

    #[test]
    fn values_of_different_types_are_independent() {
        let part = Component::points(vec![[1.0, 2.0, 3.0]]);
        assert_eq!(highest(&part), 2.0);
        assert_eq!(*part.derived(|part| part.point_count()), 1);
        assert_eq!(highest(&part), 2.0);
    }

    #[test]
    fn equal_arrays_are_shared_with_another_component_and_with_them_what_is_derived() {
        let part = || {
            let mut part = Component::curves(vec![2], vec![[0.0, 1.0, 0.0], [0.0, 3.0, 0.0]]).unwrap();
            part.set(ENVELOPE, vec![0.0, 1.0]).unwrap();
            part
        };
        let (known, mut read) = (part(), part());
        let derived = known.derived(|part| Highest(highest(part)));
        assert!(!read.topology().same(known.topology()));
        read.share_with(&known);
        assert!(read.topology().same(known.topology()));
        assert!(std::sync::Arc::ptr_eq(&derived, &read.derived(|part| Highest(highest(part)))));

        // A sign of zero is a difference.
        let mut other = part();
        other.set(ENVELOPE, vec![-0.0, 1.0]).unwrap();
        other.set(P, vec![[0.0, 1.0, 0.0], [0.0, 4.0, 0.0]]).unwrap();
        let before = other.clone();
        other.share_with(&known);
        assert_eq!(other.get(ENVELOPE).unwrap()[0].to_bits(), (-0.0_f32).to_bits());
        assert_eq!((highest(&other), other == before, other.topology().same(known.topology())), (4.0, true, true));
    }
}
