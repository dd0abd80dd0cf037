//! Panics and null pointers end no process: they become a status and a text.

use crate::guard::{HB_ABORTED, HB_FAILED, HB_OK, hb_last_error, noted, status};
use crate::{
    hb_node_file, hb_node_free, hb_node_has_parameter, hb_node_input, hb_node_join, hb_node_name,
    hb_node_numbers, hb_node_output, hb_node_parameters_json, hb_node_period_s, hb_node_run, hb_node_state,
    hb_node_text, hb_tick_fail, hb_tick_input, hb_tick_number, hb_tick_output, hb_tick_predecessor,
    hb_tick_time_ns,
};
use bus::BusError;
use std::ffi::CStr;
use std::ptr::{null, null_mut};

fn last_error() -> String {
    // SAFETY: the text is valid until the next call on this thread that fails.
    unsafe { CStr::from_ptr(hb_last_error()) }.to_string_lossy().into_owned()
}

#[test]
fn a_panic_becomes_a_status_and_a_text() {
    assert_eq!(status(|| panic!("no room for {} values", 7)), HB_FAILED);
    assert_eq!(last_error(), "hummingbus has a defect: no room for 7 values");
    assert_eq!(noted(|| panic!("no tick"), 3), 3);
    assert_eq!(last_error(), "hummingbus has a defect: no tick");
    assert_eq!(status(|| Err(BusError::Aborted)), HB_ABORTED);
    assert_eq!(status(|| Ok(())), HB_OK);
}

#[test]
fn null_pointers_are_refused_with_their_argument() {
    let (node, key) = (null_mut(), c"gain".as_ptr());
    // SAFETY: none of these calls reads memory through a null pointer.
    let statuses = unsafe {
        [
            hb_node_join(null_mut()),
            hb_node_input(node, key, null(), null_mut()),
            hb_node_output(node, key, null(), null_mut()),
            hb_node_state(node, null(), null_mut()),
            hb_node_numbers(node, key, null_mut(), 1),
            hb_node_text(node, key, null_mut()),
            hb_node_file(node, key, null_mut()),
            hb_node_parameters_json(node, null_mut()),
            hb_node_run(node, None, null_mut()),
        ]
    };
    assert_eq!(statuses, [HB_FAILED; 9]);
    assert!(last_error().contains("the argument `node` is a null pointer"), "{}", last_error());
    // SAFETY: as above.
    unsafe {
        hb_node_free(null_mut());
        assert!(hb_node_name(null()).is_null() && hb_node_period_s(null()).is_nan());
        assert!(!hb_node_has_parameter(node, key));
    }
    let tick = null_mut();
    // SAFETY: as above.
    unsafe {
        assert!(hb_tick_input(tick, 0).is_null() && hb_tick_output(tick, 0).is_null());
        assert!(hb_tick_predecessor(tick, 0).is_null());
        assert_eq!((hb_tick_number(tick), hb_tick_time_ns(tick)), (0, 0));
        assert_eq!(hb_tick_fail(tick, null()), HB_FAILED);
    }
    assert_eq!(last_error(), "the argument `tick` is a null pointer");
}
