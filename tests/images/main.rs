//! Tests of image measures, comparisons, pictures and products, of files of moving targets, and of the library's public interface.

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
mod stanag4607;
mod terrain;
