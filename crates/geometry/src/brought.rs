//! An object from the bytes of a mesh file, which says nothing of its unit, its mass and the side that it stands on:
//! what nobody says of them is assumed, so that the same file and the same words give the same object
//! everywhere; unless a [`Guide`] laid it, when [`Brought::stands`] has to be told along.

use crate::mesh::{self, Healing, Import, Mesh, MeshError, Simplified, Unit, UnitGuess};
use crate::object::{MESH_FRICTION, Object};

/// Density (kg/m³) of a mesh of which nobody says what it weighs: that of a packed box of food.
pub const DENSITY: f64 = 600.0;
/// Mass (kg) of such a mesh, at least and at most: what a hand can be asked to lift.
pub const MASSES: [f64; 2] = [0.02, 1.5];
/// Ways to stand that are looked at, the steadiest ones.
pub const MOST_RESTS: usize = 6;

/// What somebody says of a mesh file.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Told {
    /// The unit that it is drawn in.
    pub unit: Option<Unit>,
    /// Mass (kg).
    pub mass: Option<f32>,
    /// How it stands.
    pub stands: Option<Stands>,
}

/// How an object stands; written as `"asInFile"` or `{"on": 2}`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Deserialize, serde::Serialize)]
#[serde(rename_all = "camelCase")]
pub enum Stands {
    /// As its file has it.
    AsInFile,
    /// On one of the sides that hold it, the steadiest being 0.
    On(usize),
}

/// Where the mass of an object comes from.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum MassFrom {
    /// Somebody said it.
    Told,
    /// [`DENSITY`].
    Density,
    /// The least or the greatest of [`MASSES`].
    Bound(f64),
}

/// Why an object stands as it does.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "camelCase")]
pub enum Because {
    /// Somebody or the file has it so, and there is nothing to say about it.
    Given,
    /// The file looks drawn with y up.
    DrawnYUp,
    /// As its file has it, it would tip a little: it stands on the side that it would come to rest on.
    Settled,
    /// As its file has it, it would fall over: it lies on its steadiest side.
    WouldFall,
    /// It would fall over, and lies as [`Guide::lay`] has it.
    Laid,
}

impl Because {
    /// The reason as a sentence, if there is something to say.
    pub fn sentence(self) -> Option<&'static str> {
        Some(match self {
            Self::Given => return None,
            Self::DrawnYUp => "Its file looks drawn with y up, and it stands so.",
            Self::Settled => {
                "As it stands in the file it would tip a little; it stands on its foot."
            }
            Self::WouldFall => {
                "It would fall over as it stands in the file; it lies on its steadiest side."
            }
            Self::Laid => {
                "It would fall over as it stands in the file; it lies as it looks most like what the policy learned from."
            }
        })
    }
}

/// An object from a mesh file, and what was found out and assumed.
#[derive(Clone, Debug)]
pub struct Brought {
    /// The object; its name is that of the file.
    pub object: Object,
    /// Its unit, and why.
    pub unit: UnitGuess,
    /// What was repaired.
    pub healing: Healing,
    /// What was made of it before, if it had too many triangles.
    pub simplified: Option<Simplified>,
    /// Whether it is weighed by its convex hull, because its surface does not close.
    pub is_weighed_by_hull: bool,
    /// Where its mass comes from.
    pub mass: MassFrom,
    /// Sides that it can stand on.
    pub sides: usize,
    /// How it stands, and why.
    pub stands: (Stands, Because),
}

/// What reading is at; of a large mesh each takes its time.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stage {
    /// Triangles are read and healed.
    Triangles,
    /// Sides are sought that hold it.
    Sides,
    /// It is cut into convex parts.
    Parts,
}

/// Who has a mesh read.
pub trait Guide {
    /// Hears what reading is at.
    fn at(&mut self, _: Stage) {}

    /// On which of its sides a mesh lies that would fall over, of which nobody says how it stands; `None` leaves it on the
    /// steadiest, the first one.
    fn lay(&mut self, _: impl Iterator<Item = Mesh>) -> Option<usize> {
        None
    }
}

/// Nobody in particular.
impl Guide for () {}

/// Makes an object of a mesh file.
pub fn read(
    file_name: &str,
    bytes: &[u8],
    told: Told,
    guide: &mut impl Guide,
) -> Result<Brought, MeshError> {
    guide.at(Stage::Triangles);
    let Import { mesh, unit, healing, simplified, is_drawn_y_up } = mesh::import(bytes, told.unit)?;
    let solid = mesh::solid(&mesh, healing.watertight)?;
    let (kg, mass) = weigh(solid.volume, told.mass);
    guide.at(Stage::Sides);
    let mut rests = mesh::rests(&mesh.vertices, solid.center);
    // What is round has many sides, each steadier than to stand upright.
    let stays = rests.is_empty()
        || rests.iter().any(mesh::Rest::is_as_it_is)
        || mesh::stands(&mesh.vertices, solid.center);
    let drawn = rests.iter().position(mesh::Rest::is_y_up).filter(|_| is_drawn_y_up);
    let wanted = drawn.or_else(|| settled(&rests).filter(|_| !stays));
    let far = wanted.filter(|side| *side >= MOST_RESTS).map(|side| rests.remove(side));
    rests.truncate(MOST_RESTS);
    // It is one of those that are offered.
    rests.extend(far);
    let (stands, because) = match (told.stands, wanted) {
        (Some(stands), _) => (stands, Because::Given),
        (None, Some(side)) => {
            let because = if drawn.is_some() { Because::DrawnYUp } else { Because::Settled };
            (Stands::On(side.min(MOST_RESTS)), because)
        }
        (None, None) if stays => (Stands::AsInFile, Because::Given),
        (None, None) => {
            match guide.lay(rests.iter().map(|side| mesh.clone().turned(&side.rotation))) {
                Some(side) => (Stands::On(side), Because::Laid),
                None => (Stands::On(0), Because::WouldFall),
            }
        }
    };
    let (mesh, stands) = match stands {
        Stands::On(side) if side < rests.len() => (mesh.turned(&rests[side].rotation), stands),
        _ => (mesh, Stands::AsInFile),
    };
    guide.at(Stage::Parts);
    let parts = mesh::convex_parts_or_hull(&mesh).hulls;
    let object = Object::new(file_name, mesh, healing.watertight, parts, kg, MESH_FRICTION)?;
    Ok(Brought {
        object,
        unit,
        healing,
        simplified,
        is_weighed_by_hull: solid.from_hull,
        mass,
        sides: rests.len(),
        stands: (stands, because),
    })
}

/// What tips by less (cosine) to come to rest was meant to stand as it does: the foot of a scan is never flat.
const TIPS: f64 = 0.966;

/// The side on which it comes to rest if it is let go as its file has it, if it tips by 15 degrees at most.
fn settled(rests: &[mesh::Rest]) -> Option<usize> {
    let upright = |side: &usize| rests[*side].upright();
    let nearest = (0..rests.len()).max_by(|a, b| upright(a).total_cmp(&upright(b)))?;
    (upright(&nearest) > TIPS).then_some(nearest)
}

/// Mass (kg) of so many cubic metres, unless somebody says it.
fn weigh(volume: f64, told: Option<f32>) -> (f32, MassFrom) {
    if let Some(kg) = told.filter(|kg| kg.is_finite() && *kg > 0.0) {
        return (kg, MassFrom::Told);
    }
    let assumed = DENSITY * volume;
    let kg = assumed.clamp(MASSES[0], MASSES[1]);
    (kg as f32, if kg == assumed { MassFrom::Density } else { MassFrom::Bound(kg) })
}

#[cfg(test)]
mod tests {
    use super::*;

    // A box of 40 x 60 x 120 mm.
    const BOX: &str = "v 0 0 0\nv 40 0 0\nv 40 60 0\nv 0 60 0\nv 0 0 120\nv 40 0 120\nv 40 60 120\n\
        v 0 60 120\nf 1 4 3 2\nf 5 6 7 8\nf 1 2 6 5\nf 2 3 7 6\nf 3 4 8 7\nf 4 1 5 8\n";

    fn brought(text: &str, told: Told) -> Brought {
        let mut host = Host::default();
        let found = read("box.obj", text.as_bytes(), told, &mut host).unwrap();
        assert_eq!(host.0, [Stage::Triangles, Stage::Sides, Stage::Parts]);
        found
    }

    /// Wants what would fall over to stand as high as it can.
    #[derive(Default)]
    struct Host(Vec<Stage>);

    impl Guide for Host {
        fn at(&mut self, stage: Stage) {
            self.0.push(stage);
        }

        fn lay(&mut self, sides: impl Iterator<Item = Mesh>) -> Option<usize> {
            let heights = sides.map(|mesh| mesh.extent().z).enumerate();
            heights.max_by(|(_, a), (_, b)| a.total_cmp(b)).map(|(side, _)| side)
        }
    }

    #[test]
    fn what_nobody_says_is_assumed() {
        let found = brought(BOX, Told::default());
        assert_eq!((found.unit.unit, found.mass), (Unit::Millimetre, MassFrom::Density));
        assert!((f64::from(found.object.mass) - 600.0 * 0.04 * 0.06 * 0.12).abs() < 1e-6);
        assert_eq!((found.sides, found.stands), (6, (Stands::AsInFile, Because::Given)));
    }

    #[test]
    fn what_somebody_says_counts() {
        let told = Told { unit: Some(Unit::Inch), mass: Some(0.3), stands: Some(Stands::On(0)) };
        let found = brought(&BOX.replace("120", "12").replace("60", "6").replace("40", "4"), told);
        assert_eq!((found.object.mass, found.mass), (0.3, MassFrom::Told));
        // It lies on its largest side, 6 x 12 inches: 4 are its height.
        assert!((found.object.size().z - 4.0 * 0.0254).abs() < 1e-6, "{}", found.object.size());
    }

    #[test]
    fn what_is_tiny_or_huge_weighs_what_a_hand_can_lift() {
        for (unit, kg) in [(Unit::Centimetre, 1.5), (Unit::Millimetre, 0.02)] {
            let text = BOX.replace("120", "30").replace("60", "30").replace("40", "30");
            let found = brought(&text, Told { unit: Some(unit), ..Told::default() });
            assert_eq!(found.mass, MassFrom::Bound(kg));
            assert_eq!(found.object.mass, kg as f32);
        }
    }

    #[test]
    fn what_only_tips_a_little_stands_on_its_foot() {
        // One corner of the foot is 5 mm too long.
        let uneven = BOX.replace("v 40 60 0", "v 40 60 -5");
        let found = brought(&uneven, Told::default());
        assert!(matches!(found.stands, (Stands::On(_), Because::Settled)), "{:?}", found.stands);
        assert!((0.115..0.13).contains(&found.object.size().z), "{}", found.object.size());
    }

    #[test]
    fn what_would_rock_on_a_bulge_stands() {
        let bulge = BOX.replace("v 0 60 120\n", "v 0 60 120\nv 20 30 -0.5\n");
        let bulge = bulge.replace("f 1 4 3 2", "f 1 4 9\nf 4 3 9\nf 3 2 9\nf 2 1 9");
        assert_eq!(brought(&bulge, Told::default()).stands, (Stands::AsInFile, Because::Given));
    }

    /// The YCB scans stay outside the repository; `NGF_SCANS` names their folder.
    #[test]
    fn real_scans_stand_as_they_were_scanned() {
        let Ok(folder) = std::env::var("NGF_SCANS") else {
            println!("skipped: NGF_SCANS is not set");
            return;
        };
        let mut seen = 0;
        for entry in std::fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            let bytes = std::fs::read(&path).unwrap();
            let Ok(import) = mesh::import(&bytes, None) else { continue };
            seen += 1;
            let height = import.mesh.extent().z;
            let found = read("scan.obj", &bytes, Told::default(), &mut ()).unwrap();
            println!("{path:?}: {:?}, {} of {height} m high", found.stands, found.object.size().z);
            assert!((found.object.size().z - height).abs() < 0.03 * height, "{path:?}");
        }
        assert!(seen > 0, "NGF_SCANS has no scans");
    }

    #[test]
    fn what_would_fall_over_lies_on_its_steadiest_side_or_as_its_guide_has_it() {
        // On an edge nothing stands, whichever it is.
        for raised in
            [[[40, 60], [40, 0]], [[40, 60], [0, 60]], [[0, 60], [0, 0]], [[40, 0], [0, 0]]]
        {
            let raise = |text: String, [x, y]: [i32; 2]| {
                text.replace(&format!("v {x} {y} 0\n"), &format!("v {x} {y} 90\n"))
            };
            let tilted = raised.into_iter().fold(BOX.to_owned(), raise);
            assert_ne!(tilted, BOX);
            let lying = read("box.obj", tilted.as_bytes(), Told::default(), &mut ()).unwrap();
            assert_eq!(lying.stands.1, Because::WouldFall, "{raised:?}");
        }
        let tilted = BOX.replace("v 40 60 0", "v 40 60 90").replace("v 40 0 0", "v 40 0 90");
        let lying = read("box.obj", tilted.as_bytes(), Told::default(), &mut ()).unwrap();
        assert_eq!(lying.stands, (Stands::On(0), Because::WouldFall));
        let upright = brought(&tilted, Told::default());
        assert!(matches!(upright.stands, (Stands::On(1..), Because::Laid)), "{:?}", upright.stands);
        assert!(upright.object.size().z > lying.object.size().z);
        // A side that is told is not asked for.
        let told = Told { stands: Some(Stands::On(0)), ..Told::default() };
        assert_eq!(brought(&tilted, told).stands, (Stands::On(0), Because::Given));
        // A side that it does not have is none that it can be put on.
        let told = Told { stands: Some(Stands::On(77)), ..Told::default() };
        assert_eq!(brought(BOX, told).stands.0, Stands::AsInFile);
    }
}
