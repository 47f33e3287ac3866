//! Planning and cooking, tried with small nodes whose results can be worked by hand.

mod net;
mod nodes;
mod once;
