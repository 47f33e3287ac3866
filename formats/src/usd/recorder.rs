//! Collects frames into tracks: the values of each attribute over time, stored once while they do not change.
//!
//! Memory: the arrays of the last frame (shared with other owners), a handle of 8 bytes per attribute and frame, and 32
//! bytes per frame. A refused frame changes nothing; after a failed write all calls fail.

use std::collections::BTreeMap;
use std::io;

use engine::geometry::{Column, ColumnType, Component, Geometry, Kind, Owner, Topology, WIDTH};

use super::UsdFault;
use super::layout::{self, Derived, Source, TargetName};
use super::names;
use super::stage::{Attribute, Encoder, Handle, Prim, PrimGroup, Stage, Values, same_bits};

/// Settings of a stage.
#[derive(Clone, Debug)]
pub(super) struct Header {
    /// The output's name, not yet an identifier.
    pub(super) name: String,
    /// Frames per second.
    pub(super) fps: f64,
    /// The scene's origin, metres.
    pub(super) origin: [f64; 3],
    /// The names of the prims that hold one geometry each, not yet identifiers; without any there is one geometry, whose
    /// prims are under the root.
    pub(super) members: Vec<String>,
}

/// Why a call failed.
#[derive(Debug, thiserror::Error)]
pub(super) enum Fault {
    #[error(transparent)]
    Write(#[from] io::Error),
    #[error(transparent)]
    Refused(#[from] UsdFault),
}

/// What was recorded.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Counts {
    pub(super) frames: usize,
    pub(super) stored: u64,
    pub(super) shared: u64,
}

/// Collects frames for an encoder.
pub(super) struct Recorder<W> {
    header: Header,
    times: Vec<f64>,
    members: Vec<Member>,
    store: Store<W>,
    /// Whether attributes that do not change have time samples too.
    all_sampled: bool,
    failed: bool,
}

/// One of the geometries of each frame.
#[derive(Default)]
struct Member {
    /// The number of points of each frame's components, in the order of [`Kind::ALL`]; `None` without the component.
    points: Vec<[Option<u32>; 4]>,
    derived: [Derived; 4],
    tracks: BTreeMap<(Kind, Source), Track>,
}

/// The encoder, with counts of stored and of shared arrays.
struct Store<W> {
    encoder: Box<dyn Encoder<W>>,
    stored: u64,
    shared: u64,
}

/// One attribute's values, one per frame.
struct Track {
    rows: ColumnType,
    last: Option<(Column, Handle)>,
    samples: Vec<Handle>,
}

impl<W> Recorder<W> {
    /// A recorder without frames.
    pub(super) fn new(encoder: Box<dyn Encoder<W>>, header: Header) -> Self {
        let members = (0..header.members.len().max(1)).map(|_| Member::default()).collect();
        Self {
            header,
            times: Vec::new(),
            members,
            store: Store { encoder, stored: 0, shared: 0 },
            all_sampled: false,
            failed: false,
        }
    }

    /// Adds a frame: a geometry for each member.
    pub(super) fn frame(&mut self, time: f64, geometries: &[&Geometry]) -> Result<(), Fault> {
        self.refuse_after_failure()?;
        self.check(time, geometries)?;
        self.failed = true;
        for (member, geometry) in self.members.iter_mut().zip(geometries) {
            member.frame(geometry, self.times.len(), &mut self.store)?;
        }
        self.times.push(time);
        self.failed = false;
        Ok(())
    }

    /// Writes time samples of all attributes.
    pub(super) fn sample_all(&mut self) {
        self.all_sampled = true;
    }

    /// Writes the structure and returns the file.
    pub(super) fn finish(mut self) -> Result<(W, Counts), Fault> {
        self.refuse_after_failure()?;
        for member in &mut self.members {
            member.record_default_width(self.all_sampled, &mut self.store)?;
        }
        let Self { header, times, members, store, all_sampled, .. } = self;
        let counts = Counts { frames: times.len(), stored: store.stored, shared: store.shared };
        let own: Vec<&str> = header.members.iter().map(|name| &**name).collect();
        let named = names::distinct(&own).into_iter().zip(&header.members);
        let mut named = named.map(|(name, own)| named_differently(name, own));
        let groups =
            members.into_iter().map(|member| PrimGroup { name: named.next(), prims: member.prims(all_sampled) });
        let groups = groups.collect();
        let (name, display_name) = named_differently(names::identifier(&header.name), &header.name);
        let stage = Stage { name, display_name, fps: header.fps, origin: header.origin, times, groups };
        Ok((store.encoder.finish(&stage)?, counts))
    }

    fn refuse_after_failure(&self) -> io::Result<()> {
        if self.failed { Err(io::Error::other("an earlier frame could not be written")) } else { Ok(()) }
    }

    fn check(&self, time: f64, geometries: &[&Geometry]) -> Result<(), UsdFault> {
        if geometries.len() != self.members.len() {
            return Err(UsdFault::Members { time, found: geometries.len(), expected: self.members.len() });
        }
        if !time.is_finite() {
            return Err(UsdFault::Time { time });
        }
        if let Some(last) = self.times.last().copied().filter(|last| *last >= time) {
            return Err(UsdFault::Order { time, last });
        }
        self.members.iter().zip(geometries).try_for_each(|(member, geometry)| member.check(time, geometry))
    }
}

impl Member {
    fn check(&self, time: f64, geometry: &Geometry) -> Result<(), UsdFault> {
        if geometry.volume().is_some() {
            return Err(UsdFault::Volume { time });
        }
        for part in geometry.parts() {
            let (kind, rows) = (part.kind(), rows_to_index(part));
            if i32::try_from(rows).is_err() {
                return Err(UsdFault::TooMany { kind, rows, time });
            }
            for (owner, name, column) in part.columns() {
                let key = (kind, Source::Attribute(owner, name.clone()));
                let previous = self.tracks.get(&key).map(|track| track.rows);
                if let Some(expected) = previous.filter(|previous| *previous != column.kind()) {
                    return Err(UsdFault::Type { name: name.clone(), kind, found: column.kind(), expected, time });
                }
            }
        }
        Ok(())
    }

    /// Records the geometry of the frame that is the `count`th, from 0.
    fn frame<W>(&mut self, geometry: &Geometry, count: usize, store: &mut Store<W>) -> io::Result<()> {
        let mut points = [None; 4];
        for part in geometry.parts() {
            let kind = part.kind();
            // Below 2³¹, as checked.
            points[kind as usize] = Some(part.point_count() as u32);
            for (source, column) in self.derived[kind as usize].arrays(part) {
                self.record((kind, source), column, store)?;
            }
        }
        for ((kind, source), track) in &mut self.tracks {
            if track.samples.len() == count {
                track.record_absence(*kind, source, points[*kind as usize], store)?;
            }
        }
        self.points.push(points);
        Ok(())
    }

    /// Its prims, one for each component.
    fn prims(self, all_sampled: bool) -> Vec<Prim> {
        let mut by_kind: BTreeMap<Kind, Vec<(Source, Track)>> = BTreeMap::new();
        for ((kind, source), track) in self.tracks {
            by_kind.entry(kind).or_default().push((source, track));
        }
        by_kind.into_iter().map(|(kind, tracks)| prim(kind, tracks, all_sampled)).collect()
    }

    /// Records [`layout::DEFAULT_WIDTH`] for curves that have widths at no frame: once, or at every point of a part. Where
    /// some frames have them, the others have got theirs already ([`layout::absent`]).
    fn record_default_width<W>(&mut self, all_sampled: bool, store: &mut Store<W>) -> io::Result<()> {
        let curves = self.points.iter().any(|points| points[Kind::Curves as usize].is_some());
        let width = Source::Attribute(Owner::Point, WIDTH.name.into());
        if !curves || self.tracks.contains_key(&(Kind::Curves, width.clone())) {
            return Ok(());
        }
        let column = Column::new(vec![layout::DEFAULT_WIDTH]);
        let mut track = Track { rows: column.kind(), last: None, samples: Vec::new() };
        if all_sampled {
            // Other parts may have widths of points, and the interpolation is the same in all.
            for points in &self.points {
                track.record_absence(Kind::Curves, &width, points[Kind::Curves as usize], store)?;
            }
            self.tracks.insert((Kind::Curves, width), track);
            return Ok(());
        }
        track.record(Kind::Curves, &Source::DefaultWidth, column, store)?;
        self.tracks.insert((Kind::Curves, Source::DefaultWidth), track);
        Ok(())
    }

    fn record<W>(&mut self, key: (Kind, Source), column: Column, store: &mut Store<W>) -> io::Result<()> {
        let (kind, source) = key.clone();
        if let Some(track) = self.tracks.get_mut(&key) {
            return track.record(kind, &source, column, store);
        }
        let mut track = Track { rows: column.kind(), last: None, samples: Vec::new() };
        for points in &self.points {
            track.record_absence(kind, &source, points[kind as usize], store)?;
        }
        track.record(kind, &source, column, store)?;
        self.tracks.insert(key, track);
        Ok(())
    }
}

/// An identifier, and the name that it stands for if that differs.
fn named_differently(identifier: String, own: &str) -> (String, Option<String>) {
    let differs = identifier != own;
    (identifier, differs.then(|| own.to_owned()))
}

/// The greatest number of points or corners that an `int` array counts.
fn rows_to_index(part: &Component) -> usize {
    match part.topology() {
        Topology::Mesh(faces) => faces.corners.len().max(part.point_count()),
        _ => part.point_count(),
    }
}

impl Track {
    /// Records the value of the next frame.
    fn record<W>(&mut self, kind: Kind, source: &Source, column: Column, store: &mut Store<W>) -> io::Result<()> {
        let handle = match &self.last {
            Some((last, handle)) if same_bits(last, &column) => {
                store.shared += 1;
                *handle
            }
            _ => {
                store.stored += 1;
                store.encoder.store(layout::declare(kind, source, self.rows).kind, &column)?
            }
        };
        self.last = Some((column, handle));
        self.samples.push(handle);
        Ok(())
    }

    /// Records that the next frame has no such value; `points` is how many points its component has, if it has one.
    fn record_absence<W>(
        &mut self,
        kind: Kind,
        source: &Source,
        points: Option<u32>,
        store: &mut Store<W>,
    ) -> io::Result<()> {
        match layout::absent(kind, source, self.rows, points) {
            Some(nothing) => self.record(kind, source, nothing, store),
            None => {
                self.samples.push(Handle::BLOCK);
                Ok(())
            }
        }
    }

    fn changes(&self) -> bool {
        self.samples.windows(2).any(|pair| pair[0] != pair[1])
    }
}

/// A component's tracks as a prim.
fn prim(kind: Kind, tracks: Vec<(Source, Track)>, all_sampled: bool) -> Prim {
    let moving = tracks.iter().any(|(source, track)| layout::is_motion(source) && track.changes());
    let names = attribute_names(kind, &tracks);
    let attribute = |((source, track), (name, display_name)): ((Source, Track), (String, Option<String>))| {
        let declaration = layout::declare(kind, &source, track.rows);
        let sampled = all_sampled || track.changes() || (moving && layout::is_motion(&source));
        let values = match track.samples.first() {
            Some(first) if !sampled => Values::Default(*first),
            _ => Values::Samples(track.samples),
        };
        Attribute { name, display_name, kind: declaration.kind, interpolation: declaration.interpolation, values }
    };
    let (schema, tokens) = layout::prim(kind);
    Prim { name: kind.name(), schema, tokens, attributes: tracks.into_iter().zip(names).map(attribute).collect() }
}

/// For each track the USD name, and the name of the attribute if it differs.
fn attribute_names(kind: Kind, tracks: &[(Source, Track)]) -> Vec<(String, Option<String>)> {
    let targets = || tracks.iter().map(|(source, track)| layout::declare(kind, source, track.rows).target);
    let primvars: Vec<&str> = targets()
        .filter_map(|target| match target {
            TargetName::Primvar { name, .. } => Some(name),
            TargetName::Schema(_) => None,
        })
        .collect();
    let mut identifiers = names::distinct(&primvars).into_iter();
    targets()
        .zip(tracks)
        .map(|(target, (source, _))| match target {
            TargetName::Schema(name) => (name.to_owned(), None),
            TargetName::Primvar { name, own } => {
                let name = identifiers.next().unwrap_or_else(|| names::identifier(name));
                let ambiguous = matches!(source, Source::Attribute(..)) && layout::means_another(own);
                (format!("primvars:{name}"), (name != own || ambiguous).then(|| own.to_owned()))
            }
        })
        .collect()
}

#[cfg(test)]
mod tests;
