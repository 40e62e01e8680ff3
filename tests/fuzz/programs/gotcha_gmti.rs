#![no_main]
subaperture_fuzz::program!("gotcha_gmti");
