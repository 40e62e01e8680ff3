//! `subap plan module`: resources that the embedded module needs for the maps of a scene, or for the range profiles of a capture.

use std::path::Path;

use anyhow::Context;
use serde_json::json;
use subaperture::io::open::{Options, open_channels};
use subaperture::module::maps::Arithmetic;
use subaperture::module::plan::{
    LinkBudget, ModuleCapacity, ModulePlan, ModuleProduct, ProductLoad, Requirements,
};
use subaperture::phase_history::Collection;
use subaperture::radio::sigmf::Recording;
use subaperture::resolution::survey::Survey;

use crate::args::PlanModule;
use crate::commands::sweeps::{firsts, for_module};
use crate::config::{Session, module_error_db};
use crate::text::{self, Fact, bytes, metres};

/// Print the plan of the embedded module.
pub(crate) fn run(session: &Session, typed: &PlanModule) -> anyhow::Result<()> {
    if let [capture] = &typed.input.files[..]
        && capture.extension().is_some_and(|name| name == "sigmf-meta")
    {
        return profiles(session, typed, capture);
    }
    let channels = session.open_for_module(&typed.input, typed.send)?;
    let channels: Vec<&Collection> = channels
        .iter()
        .map(|channel| channel.collection())
        .collect();
    let survey = Survey::of(channels[0]).context("the input holds no pulses")?;
    let grid = session.grid(typed.grid.as_ref(), &survey)?;
    let requirements = Requirements {
        error_db: module_error_db(typed.error_db, typed.send),
        room: ModuleCapacity::Ram { bytes: typed.ram },
        arithmetic: if typed.fixed {
            Arithmetic::Fixed
        } else {
            Arithmetic::Float
        },
        product: typed.send,
    };
    let planning = session.progress("planning");
    let plan = ModulePlan::new(&channels, &grid, &requirements)?;
    let pulse_rate_hz = typed.pulse_rate.or(survey.pri_s.map(|pri_s| 1.0 / pri_s));
    let spacing_m = [grid.columns.step, grid.rows.step];
    let sheet = Sheet {
        typed,
        error_db: requirements.error_db,
        plan: &plan,
        link: plan.link(typed.link),
        products: ProductLoad::of_each(&plan, typed.link),
        increments: increments(session, typed, requirements.arithmetic),
        accumulates: ModuleProduct::Image.check_grid(&grid).is_ok(),
        period_s: pulse_rate_hz.map(|rate_hz| f64::from(plan.setup.num_pulses) / rate_hz),
        patch_m: (!grid.polar).then(|| {
            [
                plan.patch_pixels.columns as f64 * spacing_m[0],
                plan.patch_pixels.rows as f64 * spacing_m[1],
            ]
        }),
    };
    planning.finish();
    if session.json() {
        return text::say_json("module-plan", sheet.to_json());
    }
    text::say(sheet.to_text())?;
    Ok(())
}

/// Load of motion increments, if the input is one recording with several channels of equal pulses.
fn increments(
    session: &Session,
    typed: &PlanModule,
    arithmetic: Arithmetic,
) -> Option<ProductLoad> {
    let [input] = &typed.input.files[..] else {
        return None;
    };
    let options = Options {
        channel: None,
        memory_bytes: session.memory_bytes,
        settings: &typed.input.set,
        inference: None,
    };
    let channels = open_channels::<String>(input, None, &options).ok()?;
    (channels.len() > 1).then(|| ProductLoad::of_increments(&channels, arithmetic, typed.link))
}

/// Print the load of the range profiles of a capture of a stepped-frequency radar.
fn profiles(session: &Session, typed: &PlanModule, capture: &Path) -> anyhow::Result<()> {
    let recording = Recording::open_within(capture, session.memory_bytes / 2)?;
    let setup = for_module(recording.setup())?;
    let sweeps = firsts(&recording).len().saturating_sub(1);
    let load = ProductLoad::of_profiles(&setup, sweeps as u64, typed.link);
    if session.json() {
        let plan = json!({
            "sweeps": sweeps,
            "setup": setup,
            "products": [load],
            "recommended": "profiles",
        });
        return text::say_json("module-plan", plan);
    }
    let facts = [
        (
            "sweeps",
            format!(
                "{sweeps} of {} carriers, {} samples each; profiles of {} values",
                setup.carriers, setup.samples, setup.bins
            ),
        ),
        load_fact(&load, typed.link),
        ("recommended", "--send profiles".to_owned()),
    ];
    text::say(text::facts(&facts).join("\n"))?;
    Ok(())
}

/// Line about the traffic of a whole recording with a product.
fn load_fact(load: &ProductLoad, baud: u32) -> Fact {
    let [least, most] = load.down_bytes.map(|count| bytes(count.into()));
    let ratios = load.down_up_ratio;
    let [least_ratio, most_ratio] = ratios.map(|ratio| text::significant(ratio, 2));
    let (down, ratio) = match least == most {
        true => (most, most_ratio),
        false => (
            format!("{least} to {most}"),
            format!("{least_ratio} to {most_ratio}"),
        ),
    };
    let time_s = load.transfer_s;
    (
        load.product,
        format!(
            "{down} down for the whole recording, {ratio} of the bytes up; {time_s:.3} s at {baud} baud"
        ),
    )
}

/// Text about gaps in the track, if there are any.
pub(crate) fn gaps(plan: &ModulePlan) -> Option<String> {
    let first = plan.gaps.first()?;
    Some(format!(
        "{} before pulse {first}: a module's sub-CPIs extend across gaps, which limits their length; separate recordings \
         may have longer ones",
        match plan.gaps.len() {
            1 => "one gap".to_owned(),
            count => format!("{count} gaps, the first"),
        }
    ))
}

/// Plan with its cost.
struct Sheet<'a> {
    typed: &'a PlanModule,
    error_db: f64,
    plan: &'a ModulePlan,
    link: LinkBudget,
    products: [ProductLoad; 3],
    /// Of a recording with several channels.
    increments: Option<ProductLoad>,
    /// Whether a module can accumulate an image on this grid.
    accumulates: bool,
    /// Interval between sub-CPIs, seconds.
    period_s: Option<f64>,
    /// Patch sides along x and y, metres.
    patch_m: Option<[f64; 2]>,
}

impl Sheet<'_> {
    /// Loads of all products: of several channels detections and increments only.
    fn loads(&self) -> impl Iterator<Item = &ProductLoad> {
        let first = match self.plan.setup.num_channels {
            1 => 0,
            _ => self.products.len() - 1,
        };
        self.products[first..].iter().chain(&self.increments)
    }

    fn to_json(&self) -> serde_json::Value {
        let plan = self.plan;
        json!({
            "error_bound_db": self.error_db,
            "predicted_error_db": plan.predicted_db,
            "arithmetic": plan.arithmetic,
            "setup": plan.setup,
            "capacity": plan.capacity(),
            "sub_cpis": plan.num_sub_cpis,
            "gaps": plan.gaps,
            "patches": plan.patches,
            "patch_m": self.patch_m,
            "kernel_taps": plan.taps,
            "ram_allowed_bytes": self.typed.ram,
            "ram": plan.ram,
            "link": self.link,
            "products": self.loads().collect::<Vec<_>>(),
            "recommended": self.recommended(),
            "sub_cpi_s": self.period_s,
            "keeps_up": self.period_s.map(|period_s| self.link.keeps_up(period_s)),
            "patches_in_real_time": self.period_s.map(|period_s| self.link.patches_in(period_s)),
        })
    }

    fn to_text(&self) -> String {
        let mut facts = self.plan_facts();
        facts.extend(self.link_facts());
        facts.extend(self.product_facts());
        let mut lines = text::facts(&facts);
        lines.push(String::new());
        lines.push(self.memory_table());
        lines.join("\n")
    }

    /// Sub-CPIs, patches, maps and their error.
    fn plan_facts(&self) -> Vec<Fact> {
        let plan = self.plan;
        let setup = &plan.setup;
        let rows = plan
            .patches
            .iter()
            .map(|patch| patch.num_doppler_bins())
            .max();
        let bins = plan
            .patches
            .iter()
            .map(|patch| patch.num_range_bins())
            .max();
        let patch = match self.patch_m {
            Some([x_m, y_m]) => format!("{} by {}", metres(Some(x_m)), metres(Some(y_m))),
            None => format!(
                "{} by {} pixels",
                plan.patch_pixels.columns, plan.patch_pixels.rows
            ),
        };
        let mut facts = vec![
            (
                "sub-CPIs",
                format!(
                    "{} of {} pulses{}, {} frequencies each",
                    plan.num_sub_cpis,
                    setup.num_pulses,
                    match setup.num_channels {
                        1 => String::new(),
                        channels => format!(" in {channels} channels"),
                    },
                    setup.num_frequencies
                ),
            ),
            ("patches", format!("{} of {patch}", plan.patches.len())),
            (
                "maps",
                format!(
                    "up to {} Doppler by {} range bins, of D = {} and R = {}",
                    rows.unwrap_or(0),
                    bins.unwrap_or(0),
                    setup.doppler_length,
                    setup.range_length
                ),
            ),
            (
                "error",
                format!(
                    "{:.1} dB predicted, bound {} dB, kernels of {} taps",
                    plan.predicted_db, self.error_db, plan.taps
                ),
            ),
        ];
        if let Some(gaps) = gaps(plan) {
            facts.push(("track", gaps));
        }
        facts
    }

    /// Traffic on the link, and whether it keeps up in real time.
    fn link_facts(&self) -> Vec<Fact> {
        let link = &self.link;
        let mut facts = Vec::new();
        facts.push((
            "sub-CPI up",
            format!(
                "{}, {:.3} s at {} baud",
                bytes(link.up_bytes.into()),
                link.up_s,
                link.baud
            ),
        ));
        facts.push((
            "sub-CPI down",
            format!(
                "{}, {:.3} s; largest map {}",
                bytes(link.down_bytes.into()),
                link.down_s,
                bytes(link.map_bytes.into())
            ),
        ));
        facts.push((
            "real time",
            match self.period_s {
                Some(period_s) => format!(
                    "a sub-CPI every {period_s:.3} s: the link {}; in that time it transfers maps of {} patches",
                    if link.keeps_up(period_s) {
                        "keeps up"
                    } else {
                        "does not keep up"
                    },
                    link.patches_in(period_s)
                ),
                None => "unknown: the recording has no pulse times; give --pulse-rate".to_owned(),
            },
        ));
        facts
    }

    /// Traffic of the whole recording with each product.
    fn product_facts(&self) -> Vec<Fact> {
        let baud = self.link.baud;
        let mut facts: Vec<Fact> = self.loads().map(|load| load_fact(load, baud)).collect();
        let recommended = self.recommended();
        facts.push((
            "recommended",
            format!(
                "--send {}{}",
                recommended.name(),
                match (recommended, self.plan.product) {
                    (ModuleProduct::Image, ModuleProduct::Maps) =>
                        ", if the module has room for it: plan with --send image",
                    _ => "",
                }
            ),
        ));
        facts
    }

    /// Of maps and image, which both give the image, the one with fewer bytes; detections of several channels.
    fn recommended(&self) -> ModuleProduct {
        let [maps, image, _] = &self.products;
        if self.plan.setup.num_channels > 1 {
            return ModuleProduct::Detections;
        }
        if self.accumulates && image.down_bytes[1] < maps.down_bytes[1] {
            ModuleProduct::Image
        } else {
            ModuleProduct::Maps
        }
    }

    /// Table of buffer sizes.
    fn memory_table(&self) -> String {
        let plan = self.plan;
        let mut memory: Vec<Vec<String>> = plan
            .ram
            .buffers
            .iter()
            .map(|buffer| vec![buffer.name.to_owned(), buffer.bytes.to_string()])
            .collect();
        if plan.image_bytes > 0 {
            memory.push(vec!["image".to_owned(), plan.image_bytes.to_string()]);
        }
        memory.push(vec![
            "all buffers".to_owned(),
            plan.total_bytes().to_string(),
        ]);
        memory.push(vec!["allowed".to_owned(), self.typed.ram.to_string()]);
        memory.push(vec![
            "in addition: detections".to_owned(),
            plan.ram.detections_bytes.to_string(),
        ]);
        if plan.setup.num_channels == 2 {
            memory.push(vec![
                "in addition: map kept by --dpca".to_owned(),
                plan.ram.dpca_bytes.to_string(),
            ]);
        }
        text::table(&["memory", "bytes"], &memory)
    }
}
