//! Contacts worked by hand, then against all pairs, then bodies that rest and are rolled on.

use super::*;

mod hand;
