//! Share link to an attempt, as the page creates it: `…#v=1&o=sugar_box&…` (web/src/demo/share/share_link.ts).

use anyhow::{Context, Result, bail};
use mesh::{Unit, UpAxis};
use objects::import::{ImportOptions, MASS_LIMITS, Orientation};
use std::collections::BTreeMap;

/// Contents of a share link.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct ShareLink {
    /// Name of a built-in object or of a mesh file.
    pub(crate) object: String,
    /// Import options of the mesh file.
    pub(crate) options: ImportOptions,
    /// Hash of shape, mass and friction.
    pub(crate) object_hash: String,
    /// Object pose: x, y (m), yaw (rad).
    pub(crate) pose: [f32; 3],
    /// Seed of the sensor noise and of the pre-grasp target.
    pub(crate) seed: u64,
    /// Name of the model, and hash of its files.
    pub(crate) model: String,
    pub(crate) model_hash: Option<String>,
    /// Hash of the scene file and the robot description.
    pub(crate) scene_hash: String,
    /// Hash of the final state.
    pub(crate) final_hash: String,
}

/// Supported version of share links.
const VERSION: &str = "1";

impl ShareLink {
    /// Whether a command-line argument is a share link instead of a file path.
    pub(crate) fn looks_like(text: &str) -> bool {
        let Some(fragment) = restore_fragment(text) else { return false };
        form_urlencoded::parse(fragment.as_bytes()).any(|(name, _)| name == "v" || name == "oh")
    }

    /// Parses a share link.
    pub(crate) fn parse(text: &str) -> Result<Self> {
        let fragment = restore_fragment(text).context("the link has no part after #")?;
        let fields: BTreeMap<String, String> =
            form_urlencoded::parse(fragment.as_bytes()).into_owned().collect();
        let field = |name: &str| {
            let value = fields.get(name).filter(|value| !value.is_empty()).cloned();
            value.with_context(|| {
                format!("this link was changed on its way: part \"{name}\" is missing; ask the sender for it again")
            })
        };
        let hash = |name: &str| {
            let value = field(name)?;
            let is_hash = value.bytes().all(|byte| byte.is_ascii_hexdigit());
            is_hash.then_some(value).with_context(|| {
                format!("this link was changed on its way: part \"{name}\" is not a hash; ask the sender for it again")
            })
        };
        let version = field("v")?;
        if version != VERSION {
            bail!(
                "the link has version {version}, not {VERSION}; open it on the page that created it"
            );
        }
        let not_three = || "part \"p\" of the link is not three numbers";
        let pose: Vec<f32> = field("p")?
            .split(',')
            .map(str::parse)
            .collect::<Result<_, _>>()
            .with_context(not_three)?;
        Ok(Self {
            object: field("o")?,
            options: import_options(&fields)?,
            object_hash: hash("oh")?,
            pose: pose.try_into().ok().with_context(not_three)?,
            seed: field("s")?.parse().context("part \"s\" of the link is not a seed")?,
            model: field("m")?,
            model_hash: fields.get("mh").map(|_| hash("mh")).transpose()?,
            scene_hash: hash("sc")?,
            final_hash: hash("h")?,
        })
    }
}

/// Characters of the sentence around a link that programs take for its end. A link escapes them, except the full
/// stop, with which none ends.
const PUNCTUATION: &[char] = &[
    '.', ',', ';', ':', '!', '?', ')', ']', '}', '>', '"', '\'', '*', '\u{bb}', '\u{201d}',
    '\u{2019}',
];

/// The part of a link after `#`. Undoes the changes that mail and chat programs make: escaped separators, `&`
/// as `&amp;`, punctuation at the end.
fn restore_fragment(text: &str) -> Option<String> {
    let (_, fragment) = text.split_once('#').or_else(|| text.split_once("%23"))?;
    let fragment = fragment.trim_end().trim_end_matches(PUNCTUATION);
    let fragment = fragment.strip_prefix("%23").unwrap_or(fragment);
    let mut fragment = match fragment.contains('=') {
        true => fragment.to_owned(),
        // Separators are never escaped in a link, so all of them were, and the values twice.
        false => fragment.split('&').map(unescape).collect::<Vec<_>>().join("&"),
    };
    while fragment.contains("&amp;") {
        fragment = fragment.replace("&amp;", "&");
    }
    Some(fragment)
}

/// Removes one level of escapes from text without separators.
fn unescape(text: &str) -> String {
    form_urlencoded::parse(text.as_bytes()).map(|(name, _)| name.into_owned()).collect()
}

/// Size, up axis, mass and orientation, if specified.
fn import_options(fields: &BTreeMap<String, String>) -> Result<ImportOptions> {
    let unit = |name: &String| {
        let unit = Unit::from_symbol(name);
        unit.with_context(|| format!("part \"u\" of the link is not a supported unit: {name}"))
    };
    let up = |name: &String| {
        let up = UpAxis::from_name(name);
        up.with_context(|| format!("part \"up\" of the link is not an axis: {name}"))
    };
    let orientation = |text: &String| match text.as_str() {
        "file" => Ok(Orientation::AsInFile),
        index => index
            .parse()
            .map(Orientation::StablePose)
            .context("part \"st\" of the link is not a stable pose"),
    };
    let mass = |kg: &String| {
        let [min, max] = MASS_LIMITS;
        let kg = kg.parse().ok().filter(|kg| (min..=max).contains(&f64::from(*kg)));
        kg.context("part \"kg\" of the link is not a mass")
    };
    let number = |part: &str| {
        let number = fields.get(part).map(|text| text.parse::<f32>());
        number.transpose().with_context(|| format!("part \"{part}\" of the link is not a number"))
    };
    Ok(ImportOptions {
        unit: fields.get("u").map(unit).transpose()?,
        size: number("sz")?,
        scale: number("sf")?,
        up: fields.get("up").map(up).transpose()?,
        mass: fields.get("kg").map(mass).transpose()?,
        orientation: fields.get("st").map(orientation).transpose()?,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    const LINK: &str = "http://127.0.0.1:8787/#v=1&o=my+cup.obj&oh=ab&p=0.5%2C-0.1%2C1e-7&d=1&s=7&m=default&mh=cd&sc=ef&c=1%2C2%2C3%2C4%2C5%2C6&h=01";

    #[test]
    fn parse_reads_all_inputs_of_an_attempt() {
        assert!(ShareLink::looks_like(LINK) && !ShareLink::looks_like("recording.json"));
        let link = ShareLink::parse(LINK).unwrap();
        assert_eq!(
            (link.object.as_str(), link.pose, link.seed),
            ("my cup.obj", [0.5, -0.1, 1e-7], 7)
        );
        assert_eq!((link.model_hash.as_deref(), link.final_hash.as_str()), (Some("cd"), "01"));
        assert_eq!(link.options, ImportOptions::default());
        let options =
            ShareLink::parse(&LINK.replace("&p=", "&u=in&kg=0.25&st=2&p=")).unwrap().options;
        let orientation = Some(Orientation::StablePose(2));
        assert_eq!(
            options,
            ImportOptions {
                unit: Some(Unit::Inch),
                mass: Some(0.25),
                orientation,
                ..ImportOptions::default()
            }
        );
        let sized = LINK.replace("&p=", "&sz=0.12&up=y&p=");
        let options = ShareLink::parse(&sized).unwrap().options;
        assert_eq!((options.size, options.up), (Some(0.12), Some(UpAxis::Y)));
        let options = ShareLink::parse(&LINK.replace("&p=", "&st=file&p=")).unwrap().options;
        assert_eq!(options.orientation, Some(Orientation::AsInFile));
    }

    #[test]
    fn parse_restores_links_changed_by_mail_programs() {
        let original = ShareLink::parse(LINK).unwrap();
        let (page, fragment) = LINK.split_once('#').unwrap();
        let mut parts: Vec<&str> = fragment.split('&').collect();
        parts.reverse();
        let escaped: String = form_urlencoded::byte_serialize(fragment.as_bytes()).collect();
        for changed in [
            LINK.replace('#', "%23"),
            LINK.replace('&', "&amp;"),
            LINK.replace('&', "&amp;amp;").replace('#', "%23"),
            format!("{page}#{}", parts.join("&")),
            format!("{page}%23{escaped}"),
            format!("{page}#%23{fragment}"),
            format!("{LINK}."),
            format!("{LINK}).\n"),
            format!("{LINK}\u{201d}"),
            format!("{LINK}>"),
        ] {
            assert!(ShareLink::looks_like(&changed), "{changed}");
            assert_eq!(ShareLink::parse(&changed).unwrap(), original, "{changed}");
        }
        assert!(!ShareLink::looks_like("attempt #3.json"));
    }

    #[test]
    fn parse_names_invalid_part() {
        for (from, to, cause) in [
            ("v=1", "v=2", "version 2"),
            ("&h=01", "", "\"h\" is missing"),
            ("%2C1e-7", "", "three numbers"),
            ("s=7", "s=x", "not a seed"),
            ("&p=", "&u=ell&p=", "not a supported unit"),
            ("&p=", "&sz=big&p=", "\"sz\" of the link is not a number"),
            ("&p=", "&up=w&p=", "not an axis"),
            ("&p=", "&kg=heavy&p=", "not a mass"),
            ("&p=", "&kg=-1&p=", "not a mass"),
            ("&p=", "&kg=NaN&p=", "not a mass"),
            ("&p=", "&kg=1e30&p=", "not a mass"),
            ("&h=01", "&h=01xyz", "changed on its way: part \"h\""),
            ("&p=", "&st=head&p=", "not a stable pose"),
        ] {
            let error = ShareLink::parse(&LINK.replace(from, to)).unwrap_err();
            assert!(format!("{error:#}").contains(cause), "{error:#}");
        }
    }
}
