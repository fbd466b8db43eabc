//! Report of a dataset as one self-contained HTML page.

use crate::generate::read_grasps;
use crate::report::charts::{self, PosePoint};
use crate::report::grasp_figure;
use anyhow::{Context, Result};
use dataset::{Dataset, parquet_io};
use dataset_manifest::{Manifest, Summary};
use files::svg::escape_xml;
use geometry::Vec3;
use grasps::RobotContext;
use objects::catalog::Objects;
use robot::{DOF, JointVector, rotation};
use std::fmt::Write;

/// Maximum number of poses with a trajectory plot, and of paths per plot.
const MAX_TRAJECTORY_PLOTS: usize = 3;
const MAX_PATHS: usize = 64;

const STYLE: &str = "body{font:15px/1.5 sans-serif;color:#1f2933;max-width:1240px;margin:2em auto;\
    padding:0 1em}h2{margin-top:2.5em;border-top:1px solid #c8d0d8;padding-top:1em}\
    table{border-collapse:collapse}td,th{padding:.15em .9em .15em 0;text-align:left;\
    vertical-align:top}figure{margin:1em 0;overflow-x:auto}figcaption{color:#5b6773}";

/// Renders the report as HTML with embedded figures.
pub fn render_page(dataset: &Dataset, robot: &RobotContext, objects: &Objects) -> Result<String> {
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
        escape_xml(&manifest.generator),
        manifest.total_bytes() as f64 / 1e6,
        manifest.hash
    )?;
    for (index, name) in config.objects.iter().enumerate() {
        let counts =
            summary.get(name).with_context(|| format!("the summary has no counts of {name}"))?;
        writeln!(page, "<h2>{}</h2>{}", escape_xml(&name.replace('_', " ")), counts_table(counts))?;
        if let Some(object) = objects.get(name) {
            let set = read_grasps(dataset, name)?;
            let drawn = set.grasps.iter().enumerate().map(|(i, grasp)| {
                let poses = counts.grasps.get(&i).copied().unwrap_or(0);
                grasp_figure::draw_grasp(robot, object, grasp, i, poses)
            });
            figure(&mut page, &grasp_figure::figure_grid(drawn.collect()), "Grasps at contact.")?;
        }
        let spots = pose_points(dataset, index)?;
        let workspace = &robot.config.workspace;
        figure(
            &mut page,
            &charts::success_map(&spots, [workspace.x, workspace.y]),
            "Object poses, top view. Dot size: fraction of requested demonstrations that were kept. \
             Color: grasp, red for none. Line: yaw.",
        )?;
        figure(&mut page, &charts::outcome_bars(&counts.outcomes), "Trials by outcome.")?;
        for pose in
            spots.iter().enumerate().filter(|(_, s)| s.grasp.is_some()).take(MAX_TRAJECTORY_PLOTS)
        {
            let fan = plot_trajectories(dataset, robot, index, pose.0)?;
            let caption = format!("Palm paths into the grasp at pose {}.", pose.0);
            figure(&mut page, &fan, &caption)?;
        }
    }
    page.push_str("</html>\n");
    Ok(page)
}

fn figure(page: &mut String, svg: &str, caption: &str) -> Result<()> {
    writeln!(page, "<figure>{svg}<figcaption>{}</figcaption></figure>", escape_xml(caption))?;
    Ok(())
}

/// Counts of an object as an HTML table.
fn counts_table(s: &Summary) -> String {
    let of =
        |[k, n]: [usize; 2]| format!("{k} of {n} ({:.1} %)", 100.0 * k as f64 / n.max(1) as f64);
    let rows = [
        ("kept", of([s.kept(), s.trials()])),
        ("held for 2 s and shaken, before any filter", of(s.survived_shaking)),
        ("kept demonstrations lifted under perturbation", of(s.lifted_perturbed)),
        ("well-covered poses", of([s.well_covered, s.poses])),
        ("minimum clearance up to contact", format!("{:.2} mm", 1e3 * s.clearance[0])),
        ("duration, median and p90", format!("{:.2} and {:.2} s", s.duration[0], s.duration[1])),
        ("jerk, median and p90", format!("{:.0} and {:.0} rad/s³", s.jerk[0], s.jerk[1])),
    ];
    let rows = rows.map(|(label, value)| format!("<tr><td>{label}</td><td>{value}</td></tr>"));
    format!("<table>{}</table>", rows.concat())
}

fn pose_points(dataset: &Dataset, object: usize) -> Result<Vec<PosePoint>> {
    let batch = parquet_io::read_group(&dataset.dir.join("poses.parquet"), object)?;
    let [x, y, yaw] = ["x", "y", "yaw"].map(|name| parquet_io::floats(&batch, name));
    let (x, y, yaw) = (x?, y?, yaw?);
    let (kept, grasps) =
        (parquet_io::integers(&batch, "num_kept")?, parquet_io::integers(&batch, "grasp")?);
    let wanted = dataset.config.trajectories.max(1) as f32;
    Ok((0..x.len())
        .map(|i| PosePoint {
            pose: [x[i], y[i], yaw[i]],
            kept_fraction: kept[i] as f32 / wanted,
            grasp: usize::try_from(grasps[i]).ok(),
        })
        .collect())
}

/// Plots the palm paths at one pose.
fn plot_trajectories(
    dataset: &Dataset,
    robot: &RobotContext,
    object: usize,
    pose: usize,
) -> Result<String> {
    let record = dataset.read_pose(object, pose)?;
    let palm = |row: usize| {
        let q = &record.states[row * 2 * DOF..][..DOF];
        let q = JointVector::from_fn(|i, _| f64::from(q[i]));
        rotation::to_vec3(&robot.tree.forward_kinematics(&q).palm_pose().translation.vector)
    };
    let spans = record.offsets.windows(2).take(MAX_PATHS);
    let paths: Vec<Vec<Vec3>> =
        spans.map(|span| (span[0]..span[1]).step_by(2).map(palm).collect()).collect();
    let ends = paths.iter().filter_map(|path| path.last().copied()).take(1).collect::<Vec<_>>();
    Ok(charts::trajectory_plot(&paths, &ends))
}
