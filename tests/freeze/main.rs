//! From scene files on disk to frozen scenes.

mod files;
mod images;
mod kit;
mod placing;
