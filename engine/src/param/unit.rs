//! Units of params: printed by help and faults, and used to scale a whole scene.

/// The unit of a param's number.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Unit {
    /// A plain number.
    None,
    /// %
    Percent,
    /// m
    Metres,
    /// s
    Seconds,
    /// frames
    Frames,
    /// frame, a time
    Frame,
    /// degrees
    Degrees,
    /// radians
    Radians,
    /// m/s
    MetresPerSecond,
    /// m/s²
    MetresPerSecondSquared,
    /// 1/m
    PerMetre,
    /// 1/m²
    PerSquareMetre,
    /// 1/s
    PerSecond,
    /// 1/s²
    PerSecondSquared,
    /// Hz
    Hertz,
    /// Pa
    Pascal,
    /// Pa·s
    PascalSeconds,
    /// N
    Newtons,
    /// N/m
    NewtonsPerMetre,
    /// kg/m³
    KilogramsPerCubicMetre,
    /// m³
    CubicMetres,
    /// m³/s
    CubicMetresPerSecond,
    /// J
    Joules,
}

impl Unit {
    /// The unit's symbol; empty for a plain number.
    pub fn sign(self) -> &'static str {
        match self {
            Self::None => "",
            Self::Percent => "%",
            Self::Metres => "m",
            Self::Seconds => "s",
            Self::Frames => "frames",
            Self::Frame => "frame",
            Self::Degrees => "degrees",
            Self::Radians => "rad",
            Self::MetresPerSecond => "m/s",
            Self::MetresPerSecondSquared => "m/s²",
            Self::PerMetre => "1/m",
            Self::PerSquareMetre => "1/m²",
            Self::PerSecond => "1/s",
            Self::PerSecondSquared => "1/s²",
            Self::Hertz => "Hz",
            Self::Pascal => "Pa",
            Self::PascalSeconds => "Pa·s",
            Self::Newtons => "N",
            Self::NewtonsPerMetre => "N/m",
            Self::KilogramsPerCubicMetre => "kg/m³",
            Self::CubicMetres => "m³",
            Self::CubicMetresPerSecond => "m³/s",
            Self::Joules => "J",
        }
    }
}
