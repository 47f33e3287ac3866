//! Columns and tables: named typed arrays, shared copy-on-write.
//!
//! A clone shares its arrays; a write copies an array only if it is shared. Equal addresses ([`Column::same`])
//! therefore prove that nothing was written, which tests rely on.

use std::collections::BTreeMap;
use std::sync::Arc;

use super::GeometryError;

/// A name of an attribute, cheap to clone.
pub type Name = Arc<str>;

/// One named array: f32 or i32 rows of 1, 3 or 4 numbers.
#[derive(Clone, Debug, PartialEq)]
pub enum Column {
    /// One number per row.
    F1(Arc<Vec<f32>>),
    /// One vector per row.
    F3(Arc<Vec<[f32; 3]>>),
    /// Four numbers per row: a quaternion, a colour with alpha.
    F4(Arc<Vec<[f32; 4]>>),
    /// One integer per row.
    I1(Arc<Vec<i32>>),
    /// Three integers per row.
    I3(Arc<Vec<[i32; 3]>>),
    /// Four integers per row.
    I4(Arc<Vec<[i32; 4]>>),
}

/// The type of a column's rows.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum ColumnType {
    /// f32
    F1,
    /// [f32; 3]
    F3,
    /// [f32; 4]
    F4,
    /// i32
    I1,
    /// [i32; 3]
    I3,
    /// [i32; 4]
    I4,
}

impl ColumnType {
    /// Numbers per row.
    pub fn width(self) -> usize {
        match self {
            Self::F1 | Self::I1 => 1,
            Self::F3 | Self::I3 => 3,
            Self::F4 | Self::I4 => 4,
        }
    }

    /// Whether rows are f32 (else i32).
    pub fn is_float(self) -> bool {
        matches!(self, Self::F1 | Self::F3 | Self::F4)
    }
}

impl std::fmt::Display for ColumnType {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::F1 => "float",
            Self::F3 => "float3",
            Self::F4 => "float4",
            Self::I1 => "int",
            Self::I3 => "int3",
            Self::I4 => "int4",
        })
    }
}

/// A type that can be a row of a [`Column`].
pub trait Item: Copy + Default + PartialEq + Send + Sync + std::fmt::Debug + 'static {
    /// The column type of these rows.
    const TYPE: ColumnType;
    /// Puts an array into a column, sharing it.
    fn wrap(array: Arc<Vec<Self>>) -> Column;
    /// The array, if the column is of this type.
    fn array(column: &Column) -> Option<&Arc<Vec<Self>>>;
    /// The array for writing, if the column is of this type.
    fn array_mut(column: &mut Column) -> Option<&mut Arc<Vec<Self>>>;
}

macro_rules! items {
    ($($t:ty => $variant:ident),*) => {$(
        impl Item for $t {
            const TYPE: ColumnType = ColumnType::$variant;
            fn wrap(array: Arc<Vec<Self>>) -> Column { Column::$variant(array) }
            fn array(column: &Column) -> Option<&Arc<Vec<Self>>> {
                match column { Column::$variant(a) => Some(a), _ => None }
            }
            fn array_mut(column: &mut Column) -> Option<&mut Arc<Vec<Self>>> {
                match column { Column::$variant(a) => Some(a), _ => None }
            }
        }
    )*};
}
items!(f32 => F1, [f32; 3] => F3, [f32; 4] => F4, i32 => I1, [i32; 3] => I3, [i32; 4] => I4);

macro_rules! each {
    ($column:expr, $a:ident => $body:expr) => {
        match $column {
            Column::F1($a) => $body,
            Column::F3($a) => $body,
            Column::F4($a) => $body,
            Column::I1($a) => $body,
            Column::I3($a) => $body,
            Column::I4($a) => $body,
        }
    };
}

impl Column {
    /// A column of `rows`.
    pub fn new<T: Item>(rows: Vec<T>) -> Self {
        T::wrap(Arc::new(rows))
    }

    /// The type of the rows.
    pub fn kind(&self) -> ColumnType {
        match self {
            Self::F1(_) => ColumnType::F1,
            Self::F3(_) => ColumnType::F3,
            Self::F4(_) => ColumnType::F4,
            Self::I1(_) => ColumnType::I1,
            Self::I3(_) => ColumnType::I3,
            Self::I4(_) => ColumnType::I4,
        }
    }

    /// Number of rows.
    pub fn len(&self) -> usize {
        each!(self, a => a.len())
    }

    /// Whether there is no row.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Bytes of the array.
    pub fn bytes(&self) -> usize {
        self.len() * self.kind().width() * 4
    }

    /// Whether both are the same array in memory.
    pub fn same(&self, other: &Self) -> bool {
        self.kind() == other.kind() && self.address() == other.address()
    }

    /// Whether both have the same type and the same bits.
    pub fn has_bits_of(&self, other: &Self) -> bool {
        fn floats<const N: usize>(a: &[[f32; N]], b: &[[f32; N]]) -> bool {
            let (a, b) = (a.as_flattened(), b.as_flattened());
            a.len() == b.len() && a.iter().zip(b).all(|(a, b)| a.to_bits() == b.to_bits())
        }
        match (self, other) {
            (Self::F1(a), Self::F1(b)) => floats(a.as_chunks::<1>().0, b.as_chunks::<1>().0),
            (Self::F3(a), Self::F3(b)) => floats(a, b),
            (Self::F4(a), Self::F4(b)) => floats(a, b),
            (Self::I1(a), Self::I1(b)) => a == b,
            (Self::I3(a), Self::I3(b)) => a == b,
            (Self::I4(a), Self::I4(b)) => a == b,
            _ => false,
        }
    }

    /// The array's address: equal addresses mean one shared array.
    pub fn address(&self) -> usize {
        each!(self, a => Arc::as_ptr(a) as usize)
    }

    /// The first row with a NaN or infinity, if any.
    pub fn first_not_finite(&self) -> Option<usize> {
        // Whole chunks are tested first, because that loop is vectorised.
        fn scan<const N: usize>(rows: &[[f32; N]]) -> Option<usize> {
            let bad = |row: &[f32; N]| row.iter().any(|x| !x.is_finite());
            rows.chunks(1024).enumerate().find_map(|(k, chunk)| {
                let any = chunk.as_flattened().iter().fold(false, |any, x| any | !x.is_finite());
                any.then(|| k * 1024 + chunk.iter().position(bad).unwrap_or(0))
            })
        }
        match self {
            Self::F1(a) => scan(a.as_chunks::<1>().0),
            Self::F3(a) => scan(a),
            Self::F4(a) => scan(a),
            Self::I1(_) | Self::I3(_) | Self::I4(_) => None,
        }
    }

    /// The rows as bytes, little endian, in order: for hashing, for files, for comparing bits.
    pub fn to_bytes(&self) -> Vec<u8> {
        fn pack<const N: usize, T: Copy>(rows: &[[T; N]], put: impl Fn(T) -> [u8; 4]) -> Vec<u8> {
            rows.as_flattened().iter().flat_map(|x| put(*x)).collect()
        }
        match self {
            Self::F1(a) => pack(a.as_chunks::<1>().0, f32::to_le_bytes),
            Self::F3(a) => pack(a, f32::to_le_bytes),
            Self::F4(a) => pack(a, f32::to_le_bytes),
            Self::I1(a) => pack(a.as_chunks::<1>().0, i32::to_le_bytes),
            Self::I3(a) => pack(a, i32::to_le_bytes),
            Self::I4(a) => pack(a, i32::to_le_bytes),
        }
    }

    /// The inverse of [`Column::to_bytes`]; `None` if the length does not fit the type.
    pub fn from_bytes(kind: ColumnType, bytes: &[u8]) -> Option<Self> {
        fn unpack<const N: usize, T: Copy + Default>(bytes: &[u8], get: impl Fn([u8; 4]) -> T) -> Option<Vec<[T; N]>> {
            let (words, rest) = bytes.as_chunks::<4>();
            let (rows, odd) = words.as_chunks::<N>();
            (rest.is_empty() && odd.is_empty()).then(|| rows.iter().map(|row| row.map(&get)).collect())
        }
        fn flat<T>(rows: Option<Vec<[T; 1]>>) -> Option<Vec<T>> {
            rows.map(|rows| rows.into_iter().flatten().collect())
        }
        Some(match kind {
            ColumnType::F1 => Self::new(flat(unpack(bytes, f32::from_le_bytes))?),
            ColumnType::F3 => Self::new(unpack::<3, _>(bytes, f32::from_le_bytes)?),
            ColumnType::F4 => Self::new(unpack::<4, _>(bytes, f32::from_le_bytes)?),
            ColumnType::I1 => Self::new(flat(unpack(bytes, i32::from_le_bytes))?),
            ColumnType::I3 => Self::new(unpack::<3, _>(bytes, i32::from_le_bytes)?),
            ColumnType::I4 => Self::new(unpack::<4, _>(bytes, i32::from_le_bytes)?),
        })
    }

    /// Rows `rows[0], rows[1], …` of this column, in that order.
    ///
    /// # Panics
    /// If a row is out of range. Callers use row numbers of the same table.
    pub fn gather(&self, rows: &[u32]) -> Self {
        each!(self, a => Self::new(rows.iter().map(|&row| a[row as usize]).collect()))
    }

    /// A column of `rows` zeros of type `kind`.
    pub fn zeros(kind: ColumnType, rows: usize) -> Self {
        match kind {
            ColumnType::F1 => Self::new(vec![0.0_f32; rows]),
            ColumnType::F3 => Self::new(vec![[0.0_f32; 3]; rows]),
            ColumnType::F4 => Self::new(vec![[0.0_f32; 4]; rows]),
            ColumnType::I1 => Self::new(vec![0_i32; rows]),
            ColumnType::I3 => Self::new(vec![[0_i32; 3]; rows]),
            ColumnType::I4 => Self::new(vec![[0_i32; 4]; rows]),
        }
    }

    /// This column followed by `other`; `None` if their types differ.
    pub fn concat(&self, other: &Self) -> Option<Self> {
        fn join<T: Item>(a: &[T], b: &Column) -> Option<Column> {
            T::array(b).map(|b| Column::new([a, b].concat()))
        }
        each!(self, a => join(a, other))
    }
}

/// Named columns of one length, in the order of their names. A clone shares all of them.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Table {
    rows: usize,
    columns: Arc<BTreeMap<Name, Column>>,
}

impl Table {
    /// A table of `rows` rows and no column.
    pub fn new(rows: usize) -> Self {
        Self { rows, columns: Arc::default() }
    }

    /// The number of rows of every column.
    pub fn rows(&self) -> usize {
        self.rows
    }

    /// The column with that name.
    pub fn column(&self, name: &str) -> Option<&Column> {
        self.columns.get(name)
    }

    /// The rows of the column with that name, if they are of type `T`.
    pub fn get<T: Item>(&self, name: &str) -> Option<&[T]> {
        self.column(name).and_then(T::array).map(|a| a.as_slice())
    }

    /// Adds a column, or replaces the one with that name.
    ///
    /// # Errors
    /// If the column has another number of rows.
    pub fn set(&mut self, name: impl Into<Name>, column: Column) -> Result<(), GeometryError> {
        let name = name.into();
        if column.len() != self.rows {
            return Err(GeometryError::Rows { name, rows: column.len(), expected: self.rows });
        }
        Arc::make_mut(&mut self.columns).insert(name, column);
        Ok(())
    }

    /// The rows of the column with that name for writing, if they are of type `T`; copied first if shared.
    pub fn edit<T: Item>(&mut self, name: &str) -> Option<&mut [T]> {
        let column = Arc::make_mut(&mut self.columns).get_mut(name)?;
        T::array_mut(column).map(|array| Arc::make_mut(array).as_mut_slice())
    }

    /// Takes every array that `other` has with the same bits from there, so that both share it.
    pub fn share_with(&mut self, other: &Self) {
        let shared = |(name, column): (&Name, &Column)| {
            let theirs = other.column(name).filter(|theirs| !theirs.same(column) && theirs.has_bits_of(column))?;
            Some((name.clone(), theirs.clone()))
        };
        let shared: Vec<(Name, Column)> = self.columns.iter().filter_map(shared).collect();
        if !shared.is_empty() {
            Arc::make_mut(&mut self.columns).extend(shared);
        }
    }

    /// Removes a column.
    pub fn remove(&mut self, name: &str) -> Option<Column> {
        if !self.columns.contains_key(name) {
            return None;
        }
        Arc::make_mut(&mut self.columns).remove(name)
    }

    /// All columns, in the order of their names.
    pub fn iter(&self) -> impl Iterator<Item = (&Name, &Column)> {
        self.columns.iter()
    }

    /// Whether there is no column.
    pub fn is_empty(&self) -> bool {
        self.columns.is_empty()
    }

    /// Rows `rows` of every column, in that order.
    pub fn gather(&self, rows: &[u32]) -> Self {
        let columns = self.iter().map(|(name, column)| (name.clone(), column.gather(rows))).collect();
        Self { rows: rows.len(), columns: Arc::new(columns) }
    }

    /// The rows of this table, then those of `other`. If one of them lacks a column or has it with another type, its
    /// rows are zero (the type is that of the first table that has the column).
    pub fn concat(&self, other: &Self) -> Self {
        let mut columns = BTreeMap::new();
        for (name, column) in self.iter() {
            let zeros = || Column::zeros(column.kind(), other.rows);
            let tail = other.column(name).filter(|tail| tail.kind() == column.kind()).cloned().unwrap_or_else(zeros);
            if let Some(joined) = column.concat(&tail) {
                columns.insert(name.clone(), joined);
            }
        }
        for (name, column) in other.iter().filter(|(name, _)| self.column(name).is_none()) {
            if let Some(joined) = Column::zeros(column.kind(), self.rows).concat(column) {
                columns.insert(name.clone(), joined);
            }
        }
        Self { rows: self.rows + other.rows, columns: Arc::new(columns) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_clone_shares_until_one_side_writes() {
        let mut a = Table::new(2);
        a.set("mask", Column::new(vec![1.0_f32, 2.0])).unwrap();
        a.set("id", Column::new(vec![7, 8])).unwrap();
        let mut b = a.clone();
        assert!(a.column("mask").unwrap().same(b.column("mask").unwrap()));
        b.edit::<f32>("mask").unwrap()[0] = 5.0;
        assert_eq!(a.get::<f32>("mask").unwrap(), [1.0, 2.0]);
        assert_eq!(b.get::<f32>("mask").unwrap(), [5.0, 2.0]);
        assert!(a.column("id").unwrap().same(b.column("id").unwrap()), "only the written column is copied");
    }

    #[test]
    fn a_column_of_the_wrong_length_is_refused() {
        let error = Table::new(2).set("mask", Column::new(vec![1.0_f32])).unwrap_err();
        assert_eq!(error.to_string(), "`mask` has 1 row, expected 2");
    }

    #[test]
    fn the_first_row_that_is_not_finite_is_found() {
        let mut rows = vec![[0.0_f32; 3]; 3000];
        assert_eq!(Column::new(rows.clone()).first_not_finite(), None);
        rows[2345][1] = f32::NAN;
        rows[2999][0] = f32::INFINITY;
        assert_eq!(Column::new(rows).first_not_finite(), Some(2345));
    }

    #[test]
    fn bytes_round_trip_every_bit() {
        let column = Column::new(vec![[f32::MIN_POSITIVE / 2.0, -0.0, f32::MAX]]);
        assert_eq!(Column::from_bytes(ColumnType::F3, &column.to_bytes()), Some(column));
        assert_eq!(Column::from_bytes(ColumnType::F3, &[0; 16]), None);
    }

    #[test]
    fn joining_tables_fills_missing_columns_with_zeros() {
        let mut a = Table::new(1);
        a.set("mask", Column::new(vec![1.0_f32])).unwrap();
        let mut b = Table::new(2);
        b.set("id", Column::new(vec![4, 5])).unwrap();
        let joined = a.concat(&b);
        assert_eq!(joined.get::<f32>("mask").unwrap(), [1.0, 0.0, 0.0]);
        assert_eq!(joined.get::<i32>("id").unwrap(), [0, 4, 5]);
    }
}
