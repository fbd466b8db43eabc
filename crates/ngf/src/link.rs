//! A link to an attempt, as the page makes it: `…#v=1&o=sugar_box&…` (web/src/demo/share.ts).

use anyhow::{Context, Result, bail};
use geometry::brought::{Stands, Told};
use geometry::mesh::Unit;
use std::collections::BTreeMap;

/// What a link says.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Link {
    /// Name of a built-in object, or of a file.
    pub(crate) object: String,
    /// What was said of the file, if it is one.
    pub(crate) told: Told,
    /// Hash of the object.
    pub(crate) object_hash: String,
    /// x, y (m), yaw (rad).
    pub(crate) pose: [f32; 3],
    /// Seed of noise and target.
    pub(crate) seed: u64,
    /// Name of the model, and its hash.
    pub(crate) model: String,
    pub(crate) model_hash: Option<String>,
    /// Hash of scene file and robot.
    pub(crate) scene: String,
    /// Hash of the final state.
    pub(crate) end: String,
}

/// Of the links that are understood.
const VERSION: &str = "1";

impl Link {
    /// Whether a text is a link rather than the name of a file.
    pub(crate) fn is_one(text: &str) -> bool {
        text.contains("#v=")
    }

    /// Reads a link.
    pub(crate) fn parse(text: &str) -> Result<Self> {
        let (_, fragment) = text.split_once('#').context("the link has no part behind a #")?;
        let fields: BTreeMap<String, String> =
            form_urlencoded::parse(fragment.as_bytes()).into_owned().collect();
        let field = |name: &str| {
            let value = fields.get(name).filter(|value| !value.is_empty()).cloned();
            value.with_context(|| format!("the link is cut off: its part \"{name}\" is missing"))
        };
        let version = field("v")?;
        if version != VERSION {
            bail!("the link is of version {version}, not {VERSION}: open it where it was made");
        }
        let not_three = || "the link's part \"p\" is not three numbers";
        let pose: Vec<f32> = field("p")?
            .split(',')
            .map(str::parse)
            .collect::<Result<_, _>>()
            .with_context(not_three)?;
        Ok(Self {
            object: field("o")?,
            told: told(&fields)?,
            object_hash: field("oh")?,
            pose: pose.try_into().ok().with_context(not_three)?,
            seed: field("s")?.parse().context("the link's part \"s\" is no seed")?,
            model: field("m")?,
            model_hash: fields.get("mh").cloned(),
            scene: field("sc")?,
            end: field("h")?,
        })
    }
}

/// Unit, mass and side, as far as somebody said them.
fn told(fields: &BTreeMap<String, String>) -> Result<Told> {
    let unit = |name: &String| match name.as_str() {
        "m" => Ok(Unit::Metre),
        "cm" => Ok(Unit::Centimetre),
        "mm" => Ok(Unit::Millimetre),
        "in" => Ok(Unit::Inch),
        _ => bail!("the link's part \"u\" is no unit that meshes are drawn in: {name}"),
    };
    let stands = |side: &String| match side.as_str() {
        "file" => Ok(Stands::AsInFile),
        side => side.parse().map(Stands::On).context("the link's part \"st\" is no side"),
    };
    let mass = |kg: &String| kg.parse().context("the link's part \"kg\" is no mass");
    Ok(Told {
        unit: fields.get("u").map(unit).transpose()?,
        mass: fields.get("kg").map(mass).transpose()?,
        stands: fields.get("st").map(stands).transpose()?,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    const LINK: &str = "http://127.0.0.1:8787/#v=1&o=my+cup.obj&oh=ab&p=0.5%2C-0.1%2C1e-7&d=1&s=7&m=default&mh=cd&sc=ef&c=1%2C2%2C3%2C4%2C5%2C6&h=01";

    #[test]
    fn a_link_says_all_that_decides_an_attempt() {
        assert!(Link::is_one(LINK) && !Link::is_one("episode.json"));
        let link = Link::parse(LINK).unwrap();
        assert_eq!(
            (link.object.as_str(), link.pose, link.seed),
            ("my cup.obj", [0.5, -0.1, 1e-7], 7)
        );
        assert_eq!((link.model_hash.as_deref(), link.end.as_str()), (Some("cd"), "01"));
        assert_eq!(link.told, Told::default());
        let told = Link::parse(&LINK.replace("&p=", "&u=in&kg=0.25&st=2&p=")).unwrap().told;
        let stands = Some(Stands::On(2));
        assert_eq!(told, Told { unit: Some(Unit::Inch), mass: Some(0.25), stands });
        let told = Link::parse(&LINK.replace("&p=", "&st=file&p=")).unwrap().told;
        assert_eq!(told.stands, Some(Stands::AsInFile));
    }

    #[test]
    fn what_is_wrong_with_a_link_is_named() {
        for (from, to, cause) in [
            ("v=1", "v=2", "version 2"),
            ("&h=01", "", "\"h\" is missing"),
            ("%2C1e-7", "", "three numbers"),
            ("s=7", "s=x", "no seed"),
            ("&p=", "&u=ell&p=", "no unit"),
            ("&p=", "&kg=heavy&p=", "no mass"),
            ("&p=", "&st=head&p=", "no side"),
        ] {
            let error = Link::parse(&LINK.replace(from, to)).unwrap_err();
            assert!(format!("{error:#}").contains(cause), "{error:#}");
        }
    }
}
