//! The report of a dataset: one page that needs nothing else.

use crate::folder::Dataset;
use crate::generate::Objects;
use crate::manifest::Manifest;
use crate::report::canvas::escaped;
use crate::report::charts::{self, Spot};
use crate::report::held;
use crate::summary::Summary;
use crate::table;
use anyhow::{Context, Result};
use geometry::Vec3;
use grasps::Robot;
use robot::{DOF, JointVector, rotation};
use std::fmt::Write;

/// Poses whose trajectories are drawn, and how many of each at most.
const FANS: usize = 3;
const PATHS: usize = 64;

const STYLE: &str = "body{font:15px/1.5 sans-serif;color:#1f2933;max-width:1240px;margin:2em auto;\
    padding:0 1em}h2{margin-top:2.5em;border-top:1px solid #c8d0d8;padding-top:1em}\
    table{border-collapse:collapse}td,th{padding:.15em .9em .15em 0;text-align:left;\
    vertical-align:top}figure{margin:1em 0;overflow-x:auto}figcaption{color:#5b6773}";

/// The report as HTML with its pictures in it.
pub fn report(dataset: &Dataset, robot: &Robot, objects: &Objects) -> Result<String> {
    let (manifest, summary) = (Manifest::read(&dataset.dir)?, dataset.summary()?);
    let config = &dataset.config;
    let mut page = String::new();
    writeln!(
        page,
        "<!doctype html><html lang=\"en\"><meta charset=\"utf-8\"><title>Dataset</title>\
         <style>{STYLE}</style><h1>Dataset</h1><p>{} poses of each of {} objects, up to {} \
         demonstrations of each; seed {}, {}, {:.1} MB<br>hash <code>{}</code></p>",
        config.poses,
        config.objects.len(),
        config.trajectories,
        config.seed,
        escaped(&manifest.generator),
        manifest.bytes() as f64 / 1e6,
        manifest.hash
    )?;
    for (index, name) in config.objects.iter().enumerate() {
        let counts = summary.get(name).with_context(|| format!("no counts of {name}"))?;
        writeln!(page, "<h2>{}</h2>{}", escaped(&name.replace('_', " ")), figures(counts))?;
        if let Some(object) = objects.get(name) {
            let set = dataset.grasps(name)?;
            let drawn = set.grasps.iter().enumerate().map(|(i, grasp)| {
                let poses = counts.grasps.get(&i).copied().unwrap_or(0);
                held::picture(robot, object, grasp, i, poses)
            });
            figure(&mut page, &held::row(drawn.collect()), "Grasps, when the fingers touch.")?;
        }
        let spots = spots(dataset, index)?;
        let workspace = &robot.config.workspace;
        figure(
            &mut page,
            &charts::table(&spots, [workspace.x, workspace.y]),
            "Where the object stood, from above. A dot is as large as the share of wanted \
             demonstrations that were kept, its colour is that of the grasp, red for none; the line \
             shows the yaw.",
        )?;
        figure(&mut page, &charts::fates(&counts.fates), "What became of the attempts.")?;
        for pose in spots.iter().enumerate().filter(|(_, s)| s.grasp.is_some()).take(FANS) {
            let fan = fan(dataset, robot, index, pose.0)?;
            let caption = format!("Paths of the palm into the grasp at pose {}.", pose.0);
            figure(&mut page, &fan, &caption)?;
        }
    }
    page.push_str("</html>\n");
    Ok(page)
}

fn figure(page: &mut String, svg: &str, caption: &str) -> Result<()> {
    writeln!(page, "<figure>{svg}<figcaption>{}</figcaption></figure>", escaped(caption))?;
    Ok(())
}

/// The counts of an object as a table.
fn figures(s: &Summary) -> String {
    let of =
        |[k, n]: [usize; 2]| format!("{k} of {n} ({:.1} %)", 100.0 * k as f64 / n.max(1) as f64);
    let agreement = |[[a, b], [c, d]]: [[usize; 2]; 2]| of([a + d, a + b + c + d]);
    let rows = [
        ("kept", of([s.kept(), s.attempts()])),
        ("lifted with arm and hand before any filter", of(s.unfiltered)),
        ("hand alone agrees with arm and hand", agreement(s.agreement)),
        ("the same, 2 s and shaken", agreement(s.endurance)),
        ("kept ones lift beside their place", of(s.perturbed)),
        ("poses with enough", of([s.enough, s.poses])),
        ("least gap up to touch", format!("{:.2} mm", 1e3 * s.clearance[0])),
        ("duration, median and 9 of 10", format!("{:.2} and {:.2} s", s.seconds[0], s.seconds[1])),
        ("jerk, median and 9 of 10", format!("{:.0} and {:.0} rad/s³", s.jerk[0], s.jerk[1])),
    ];
    let rows = rows.map(|(what, value)| format!("<tr><td>{what}</td><td>{value}</td></tr>"));
    format!("<table>{}</table>", rows.concat())
}

fn spots(dataset: &Dataset, object: usize) -> Result<Vec<Spot>> {
    let batch = table::read_group(&dataset.dir.join("poses.parquet"), object)?;
    let [x, y, yaw] = ["x", "y", "yaw"].map(|name| table::floats(&batch, name));
    let (x, y, yaw) = (x?, y?, yaw?);
    let (kept, grasps) = (table::integers(&batch, "kept")?, table::integers(&batch, "grasp")?);
    let wanted = dataset.config.trajectories.max(1) as f32;
    Ok((0..x.len())
        .map(|i| Spot {
            pose: [x[i], y[i], yaw[i]],
            share: kept[i] as f32 / wanted,
            grasp: usize::try_from(grasps[i]).ok(),
        })
        .collect())
}

/// The palm's paths at one pose.
fn fan(dataset: &Dataset, robot: &Robot, object: usize, pose: usize) -> Result<String> {
    let record = dataset.pose(object, pose)?;
    let palm = |row: usize| {
        let q = &record.states[row * 2 * DOF..][..DOF];
        let q = JointVector::from_fn(|i, _| f64::from(q[i]));
        rotation::to_vec3(&robot.tree.kinematics(&q).palm().translation.vector)
    };
    let spans = record.offsets.windows(2).take(PATHS);
    let paths: Vec<Vec<Vec3>> =
        spans.map(|span| (span[0]..span[1]).step_by(2).map(palm).collect()).collect();
    let ends = paths.iter().filter_map(|path| path.last().copied()).take(1).collect::<Vec<_>>();
    Ok(charts::fan(&paths, &ends))
}
