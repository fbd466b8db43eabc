//! How like what the encoder learned from an object looks, in words.

/// What the encoder makes of an object that it learned from is off by less (m): with models/families and models/default
/// by 3.4 to 5.8 mm, medians of four looks at each (`ngf evaluate` says it).
const LIKE: f32 = 0.006;
/// Objects that it does not tell from others are off by more (m): the duck, the toy car and the hammer by 7.9 to 30 mm.
const UNLIKE: f32 = 0.0075;

/// From how far (m) what the encoder makes of a cloud is from the cloud.
pub(crate) fn words(off: f32) -> String {
    let what = match off {
        off if off < LIKE => "like what it learned from",
        off if off < UNLIKE => "a little unlike what it learned from",
        _ => "unlike anything it learned from",
    };
    format!("{what}: the encoder is off by {:.1} mm", 1000.0 * off)
}

#[cfg(test)]
mod tests {
    use super::*;
    use wasm_bindgen_test::wasm_bindgen_test as test;

    #[test]
    fn what_is_off_by_more_is_less_like() {
        assert_eq!(words(0.0042), "like what it learned from: the encoder is off by 4.2 mm");
        assert!(words(0.0066).starts_with("a little unlike"));
        assert!(words(0.0302).starts_with("unlike anything"));
        assert!(words(f32::INFINITY).starts_with("unlike anything"));
    }
}
