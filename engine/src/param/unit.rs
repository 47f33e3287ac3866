//! Units of params: printed by help and faults, and used to scale a whole scene.

/// The unit of a param's number.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Unit {
    /// A plain number.
    None,
    /// m
    Metres,
    /// s
    Seconds,
    /// frames
    Frames,
    /// frame, a place on the axis
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
    /// N/m
    NewtonsPerMetre,
    /// kg/m³
    KilogramsPerCubicMetre,
    /// m³/s
    CubicMetresPerSecond,
    /// J
    Joules,
}

impl Unit {
    /// The unit's sign; empty for a plain number.
    pub fn sign(self) -> &'static str {
        match self {
            Self::None => "",
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
            Self::NewtonsPerMetre => "N/m",
            Self::KilogramsPerCubicMetre => "kg/m³",
            Self::CubicMetresPerSecond => "m³/s",
            Self::Joules => "J",
        }
    }

    /// Power of length in the unit: what a number is multiplied by when the scene is scaled is scale to this power
    /// (kilograms and seconds kept).
    pub fn length_power(self) -> i32 {
        match self {
            Self::Metres | Self::MetresPerSecond | Self::MetresPerSecondSquared => 1,
            Self::CubicMetresPerSecond => 3,
            Self::Joules => 2,
            Self::PerMetre | Self::Pascal | Self::PascalSeconds => -1,
            Self::PerSquareMetre => -2,
            Self::KilogramsPerCubicMetre => -3,
            Self::None
            | Self::Seconds
            | Self::Frames
            | Self::Frame
            | Self::Degrees
            | Self::Radians
            | Self::PerSecond
            | Self::PerSecondSquared
            | Self::Hertz
            | Self::NewtonsPerMetre => 0,
        }
    }
}
