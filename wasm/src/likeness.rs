//! How like what the model learned from an object looks, in words.
//!
//! What the encoder is off by decides, and the nearest encoding only names an object: the duck, which models/paper never
//! lifts, is nearer to what that learned (4.8, the median of seeds 0 to 11, counted once) than the cracker box is (5.7),
//! of which it lifts a third.

use crate::upload::label;
use rollout::Likeness;

/// What the encoder makes of an object that it learned from is off by less (m): with models/default and models/paper
/// by 3.4 to 5.8 mm, medians of four looks at each (`ngf evaluate` says it).
const LIKE: f32 = 0.006;
/// Objects that it does not tell from others are off by more (m): the duck, the toy car and the hammer by 7.9 to 30 mm.
const UNLIKE: f32 = 0.0075;

/// What the page says of it.
pub(crate) fn words(likeness: &Likeness) -> String {
    let what = match likeness.off {
        off if off < LIKE => "like what it learned from",
        off if off < UNLIKE => "a little unlike what it learned from",
        _ => "unlike anything it learned from",
    };
    let most = likeness.most.as_ref().map(|nearest| {
        format!(
            ", most like the {}, {:.1} apart in z",
            label(nearest.base()).to_lowercase(),
            nearest.distance
        )
    });
    format!(
        "{what}{}: the encoder is off by {:.1} mm",
        most.unwrap_or_default(),
        1000.0 * likeness.off
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use rollout::likeness::Nearest;
    use wasm_bindgen_test::wasm_bindgen_test as test;

    fn said(off: f32) -> String {
        words(&Likeness { off, most: None })
    }

    #[test]
    fn what_is_off_by_more_is_less_like() {
        assert_eq!(said(0.0042), "like what it learned from: the encoder is off by 4.2 mm");
        assert!(said(0.0066).starts_with("a little unlike"));
        assert!(said(0.0302).starts_with("unlike anything"));
        assert!(said(f32::INFINITY).starts_with("unlike anything"));
    }

    #[test]
    fn it_names_what_it_looks_like_most() {
        let most = Some(Nearest { object: "soup_can.2".into(), distance: 1.26 });
        let words = words(&Likeness { off: 0.0042, most });
        let wanted = "like what it learned from, most like the soup can, 1.3 apart in z: the encoder is off by 4.2 mm";
        assert_eq!(words, wanted);
    }
}
