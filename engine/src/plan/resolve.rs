//! A node's params at any time: evaluates sources, checks ranges, opens files, and replaces params that are not read by
//! their defaults.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use crate::error::{Error, Result};
use crate::files::{Files, RELATIVE_PATHS, existing_frames, numbered_path};
use crate::graph::{Body, Graph, GraphNode};
use crate::param::{Clock, ParamSpec, Params, ReadLog, Source, Unset, Value};
use crate::time::Frame;

/// A file of a sequence.
pub(crate) struct SequenceFile<'s> {
    /// The param with the sequence, and its path.
    pub(crate) param: &'static str,
    pub(crate) sequence: &'s Path,
    /// The file's number and path.
    pub(crate) frame: i64,
    pub(crate) path: PathBuf,
}

/// Evaluates the params of one node.
pub(crate) struct Resolver<'g> {
    specs: Arc<[ParamSpec]>,
    sources: &'g [Source],
    log: Arc<ReadLog>,
    files: Arc<Files>,
    clock: Clock,
    animated: bool,
    /// The params, if they are the same at all times.
    constant: Option<Result<Params>>,
}

impl<'g> Resolver<'g> {
    pub(crate) fn new(node: &'g GraphNode, graph: &Graph, files: &Arc<Files>) -> Self {
        let mut resolver = Self::lazy(node, graph, files);
        let start = graph.scene.start();
        // An animated param that is not read does not make the node animated.
        resolver.animated = match resolver.evaluate(start.number(), false) {
            Ok(params) => (0..resolver.sources.len()).any(|index| resolver.is_param_animated(index, &params)),
            Err(_) => resolver.sources.iter().any(Source::is_animated),
        };
        if !resolver.animated {
            resolver.constant = Some(resolver.evaluate(start.number(), false));
        }
        resolver
    }

    /// The resolver of a node on which no requested output depends: params are evaluated and files opened only on
    /// request.
    pub(crate) fn lazy(node: &'g GraphNode, graph: &Graph, files: &Arc<Files>) -> Self {
        let (specs, sources) = match &node.body {
            Body::Node { specs, params, .. } => (specs.clone(), &**params),
            Body::Given { .. } => (Arc::from([]), &[][..]),
        };
        Self {
            log: Arc::new(ReadLog::new(specs.len())),
            specs,
            sources,
            files: files.clone(),
            clock: graph.scene.clock(),
            animated: false,
            constant: None,
        }
    }

    fn is_param_animated(&self, index: usize, params: &Params) -> bool {
        self.sources[index].is_animated() && self.is_read(index, params)
    }

    /// Whether the node reads the param, given the others. A param whose default is the current frame selects a file of
    /// a sequence, or a time of a file, so it is not read without either.
    fn is_read(&self, index: usize, params: &Params) -> bool {
        let facts = &self.specs[index].facts;
        let selects = matches!(facts.unset, Unset::CurrentFrame | Unset::CurrentTime);
        let timed = || facts.timed.is_some_and(|timed| timed(params));
        facts.when.is_none_or(|when| when(params)) && (!selects || self.reads_sequence() || timed())
    }

    /// Whether any param that is read changes with time.
    pub(crate) fn is_animated(&self) -> bool {
        self.animated
    }

    /// Whether any param with `history` changes with time.
    pub(crate) fn history_is_animated(&self) -> bool {
        self.specs.iter().zip(self.sources).any(|(spec, source)| spec.facts.history && source.is_animated())
    }

    /// The params at `frame`.
    pub(crate) fn at(&self, frame: Frame) -> Result<Params> {
        match &self.constant {
            Some(params) => params.clone(),
            None => self.evaluate(frame.number(), false),
        }
    }

    /// The params at a frame number with any fraction, for integrals over time. Params with `history` keep their value
    /// here even if others make them unread.
    pub(crate) fn past(&self, frame: f64) -> Result<Params> {
        self.evaluate(frame, true)
    }

    /// The params at `frame` without opening files: cheap enough for every frame of a scene.
    pub(crate) fn unopened(&self, frame: Frame) -> Result<Params> {
        self.values(frame.number(), false)
    }

    /// Whether a param is a file.
    pub(crate) fn reads_files(&self) -> bool {
        self.sources.iter().any(|source| matches!(source, Source::File { .. }))
    }

    /// Whether a param is a sequence of files.
    pub(crate) fn reads_sequence(&self) -> bool {
        self.sources.iter().any(Source::is_sequence)
    }

    /// The files of sequences that `params` select.
    pub(crate) fn sequence_files(&self, params: &Params) -> impl Iterator<Item = SequenceFile<'_>> {
        let frame = self.file_frame(params);
        self.specs.iter().zip(self.sources).filter_map(move |(spec, source)| match source {
            Source::File { path: sequence, numbered: true } => {
                Some(SequenceFile { param: spec.name, sequence, frame, path: numbered_path(sequence, frame) })
            }
            _ => None,
        })
    }

    /// The error of a sequence's file, with a hint at how to hold the first or the last file, if it is missing before or
    /// after them.
    pub(crate) fn with_how_to_hold(&self, error: Error, sequence: &Path, frame: i64) -> Error {
        if error.hint.as_deref() != Some(RELATIVE_PATHS) {
            return error;
        }
        let (number, ends, function, side) = match existing_frames(sequence) {
            Some((first, _)) if frame < first => (first, "starts", "max", "before"),
            Some((_, last)) if frame > last => (last, "ends", "min", "after"),
            _ => return error,
        };
        let by_default = |index: usize| matches!(self.sources[index], Source::CurrentFrame | Source::CurrentTime);
        let how = match self.specs.iter().position(|spec| spec.name == "frame") {
            Some(index) if by_default(index) => {
                format!(
                    r#"the node's param `"frame": {{ "expr": "{function}(frame, {number})" }}` holds that file {side} it"#
                )
            }
            _ => format!("its param `frame`, put into `{function}(…, {number})`, holds that file {side} it"),
        };
        error.hint(format!("the sequence {ends} at {number}; {how}"))
    }

    fn evaluate(&self, frame: f64, past: bool) -> Result<Params> {
        let params = self.with_files(self.values(frame, past)?)?;
        // Whether a file has several times is known when it is open.
        let is_timed = self.specs.iter().any(|spec| spec.facts.timed.is_some());
        Ok(if is_timed { self.without_unread(params, past) } else { params })
    }

    fn values(&self, frame: f64, past: bool) -> Result<Params> {
        let mut values = Vec::with_capacity(self.sources.len());
        for (spec, source) in self.specs.iter().zip(self.sources) {
            let value = source.at(frame, self.clock);
            // Integrals over the past read only these; illegal past values of the others do not matter.
            let matters = !past || spec.facts.history || spec.facts.fixed;
            if let Some((fact, hint)) = spec.refuses(&value).filter(|_| matters) {
                return Err(Error::refused(fact).hint(hint).of(spec.name));
            }
            values.push(value);
        }
        let params = Params { specs: self.specs.clone(), values: values.into(), log: self.log.clone() };
        Ok(self.without_unread(params, past))
    }

    fn without_unread(&self, mut params: Params, past: bool) -> Params {
        let in_past = |index: usize| past && self.specs[index].facts.history;
        let unread = (0..self.specs.len()).filter(|index| !in_past(*index) && !self.is_read(*index, &params));
        let unread: Vec<usize> = unread.collect();
        if !unread.is_empty() {
            let mut values = params.values.to_vec();
            for index in unread {
                values[index] = self.specs[index].default.clone();
            }
            params.values = values.into();
        }
        params
    }

    fn with_files(&self, mut params: Params) -> Result<Params> {
        let paths = self.sources.iter().enumerate().filter_map(|(index, source)| match source {
            Source::File { path, numbered } => Some((index, path, *numbered)),
            _ => None,
        });
        let mut values: Option<Vec<Value>> = None;
        for (index, path, numbered) in paths {
            let file = match numbered {
                false => self.files.open(path)?,
                true => {
                    let frame = self.file_frame(&params);
                    let file = self.files.open(&numbered_path(path, frame));
                    file.map_err(|error| self.with_how_to_hold(error, path, frame))?
                }
            };
            let file = match self.specs[index].facts.companions {
                Some(companions) => {
                    let others = companions(&file, self.file_time(&params))?;
                    file.read_with(&others)
                }
                None => file,
            };
            values.get_or_insert_with(|| params.values.to_vec())[index] = Value::File(Some(file));
        }
        if let Some(values) = values {
            params.values = values.into();
        }
        Ok(params)
    }

    /// The frame number that replaces `####`: the node's param `frame`.
    fn file_frame(&self, params: &Params) -> i64 {
        self.file_time(params).floor() as i64
    }

    /// The time at which a file is read: the same, with its fraction.
    fn file_time(&self, params: &Params) -> f64 {
        let index = self.specs.iter().position(|spec| spec.name == "frame");
        index.map_or(0.0, |index| params.values[index].number())
    }
}
