//! The AFRL GOTCHA volumetric data set: MATLAB v5 files, read.
