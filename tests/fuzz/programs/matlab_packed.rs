#![no_main]
subaperture_fuzz::program!("matlab_packed");
