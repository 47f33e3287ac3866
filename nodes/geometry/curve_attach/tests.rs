//! Laws of attached curves.

use super::*;
use engine::testing::conforms;

#[test]
fn it_conforms() {
    conforms(&NODE);
}
