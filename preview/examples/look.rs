//! Draws obj files into one picture, to inspect the rasteriser.
//!
//! `cargo run --release -p preview --example look -- OUT.png [--size WxH] [--camera TEXT] [--color-by NAME]
//! [--curve-width METRES] [--note TEXT] [--repeat N] FILE.obj…`. Reads `v`, `f` and `l` lines. `--color-by` knows
//! `along` (root to tip), `length` (of a curve) and `height`.

use std::error::Error;
use std::fs;
use std::path::Path;

use engine::geometry::{Column, Component, Geometry, Owner};
use numerics::vector;
use preview::{Layer, PictureSettings, render};

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1);
    let out = arguments.next().ok_or("expected the name of the picture")?;
    let (mut settings, mut files, mut repeat) = (PictureSettings::default(), Vec::new(), 1_usize);
    while let Some(argument) = arguments.next() {
        let mut value = || arguments.next().ok_or(format!("`{argument}` needs a value"));
        match argument.as_str() {
            "--size" => {
                let value = value()?;
                let (width, height) = value.split_once('x').ok_or("expected a size like `960x720`")?;
                (settings.width, settings.height) = (width.parse()?, height.parse()?);
            }
            "--camera" => settings.camera = Some(value()?.parse()?),
            "--color-by" => settings.color_by = Some(value()?),
            "--curve-width" => settings.curve_width = Some(value()?.parse()?),
            "--note" => settings.note = Some(value()?),
            "--repeat" => repeat = value()?.parse()?,
            _ => files.push(argument),
        }
    }
    let geometries = files.iter().map(|file| read(&fs::read_to_string(file)?)).collect::<Result<Vec<_>, _>>()?;
    let name = |file| Path::new(file).file_stem().and_then(|stem| stem.to_str()).unwrap_or_default();
    let layers: Vec<Layer<'_>> =
        files.iter().zip(&geometries).map(|(file, part)| Layer::new(name(file), part)).collect();
    for _ in 1..repeat {
        render(&layers, &settings)?;
    }
    render(&layers, &settings)?.write_png(fs::File::create(&out)?)?;
    Ok(())
}

fn read(text: &str) -> Result<Geometry, Box<dyn Error>> {
    let (mut points, mut lines, mut faces) = (Vec::new(), Vec::new(), Vec::new());
    for line in text.lines() {
        let mut words = line.split_whitespace();
        let head = words.next();
        let corners = |words: std::str::SplitWhitespace<'_>| -> Result<Vec<u32>, Box<dyn Error>> {
            words.map(|word| Ok(word.split('/').next().unwrap_or(word).parse::<u32>()? - 1)).collect()
        };
        match head {
            Some("v") => {
                let at = words.take(3).map(str::parse).collect::<Result<Vec<f32>, _>>()?;
                points.push(<[f32; 3]>::try_from(at).map_err(|_| "expected three coordinates")?);
            }
            Some("l") => lines.push(corners(words)?),
            Some("f") => faces.push(corners(words)?),
            _ => {}
        }
    }
    let count = |rows: &[Vec<u32>]| rows.iter().map(|row| row.len() as u32).collect::<Vec<_>>();
    let mut part = if !lines.is_empty() {
        let at: Vec<[f32; 3]> = lines.iter().flatten().map(|row| points[*row as usize]).collect();
        let along = lines.iter().flat_map(|line| (0..line.len()).map(|k| k as f32 / (line.len() - 1).max(1) as f32));
        let mut curves = Component::curves(count(&lines), at.clone())?;
        curves.set_column(Owner::Point, "along", Column::new(along.collect::<Vec<_>>()))?;
        let length = |range: std::ops::Range<usize>| -> f32 {
            at[range].windows(2).map(|pair| vector::length(vector::sub(pair[1], pair[0]))).sum()
        };
        let lengths = curves.runs().ranges().map(length).collect::<Vec<_>>();
        curves.set_column(Owner::Element, "length", Column::new(lengths))?;
        curves
    } else if !faces.is_empty() {
        Component::mesh(count(&faces), faces.concat(), points)?
    } else {
        Component::points(points)
    };
    let height = part.positions().iter().map(|p| p[1]).collect::<Vec<_>>();
    part.set_column(Owner::Point, "height", Column::new(height))?;
    Ok(part.into())
}
