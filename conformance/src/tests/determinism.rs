//! Bits depend on inputs, params and frame only.

use super::*;

#[test]
fn a_node_that_keeps_state_is_found() {
    static CALLS: AtomicU32 = AtomicU32::new(0);
    let node = shift(|cx| {
        let calls = CALLS.fetch_add(1, Ordering::Relaxed);
        Ok(OUT.with(up(cx, cx.get(AMOUNT) + calls as f32)?))
    });
    finds(node, "it gives different bits on a second run");
}

#[test]
fn a_node_that_counts_threads_is_found() {
    let node = shift(|cx| {
        let threads = rayon::current_num_threads();
        Ok(OUT.with(up(cx, cx.get(AMOUNT) * threads as f32)?))
    });
    let found = findings_of(node);
    assert_eq!(found, [2, 7].map(|threads| format!("it gives different bits on {threads} threads and on one")));
}
