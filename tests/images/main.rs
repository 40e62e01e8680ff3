//! Tests of image measures, comparisons, pictures and products, and of the library's public interface.

mod compare;
mod decoded;
mod examples;
mod features;
mod made;
mod maps;
mod pairs;
mod plot_lines;
mod product;
mod quality;
mod quicklook;
mod terrain;
