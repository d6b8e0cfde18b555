//! From a record to parameters: least squares, swarm search, and a physically consistent leg.
//!
//! | file | content | source |
//! | --- | --- | --- |
//! | `estimate` | noise weights, stages, least squares and its covariance | |
//! | `selection` | drops columns that the data do not determine, where allowed | Draper and Smith, ch. 15 |
//! | `bounds` | the search box that the prior allows | |
//! | `search` | beetle swarm in the box | |
//! | `constrained` | least squares in the box: the swarm's reference | Stark and Parker 1995 |
//! | `completion` | fourteen parameters of every joint in closed form, each with its status | |
//! | `consistent` | the nearest physically consistent leg | Nesterov and Nemirovskii 1994 |
//! | `scale` | torque constants from two records, without and with a known mass | Gautier and Briot 2014 |
//! | `solver` | one identification with all these steps, in slices | |

pub(crate) mod bounds;
pub(crate) mod completion;
pub(crate) mod consistent;
pub(crate) mod constrained;
pub(crate) mod estimate;
pub(crate) mod scale;
pub(crate) mod search;
pub mod selection;
pub mod solver;
#[cfg(test)]
pub(in crate::ident) mod testing;
