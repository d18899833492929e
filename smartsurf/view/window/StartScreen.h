// The window that a program without arguments shows: a gallery of experiments, recent files, and files on
// disk.
//
// Main thread only, while there is no Window. In a build without the view, choose_file() returns "".
#pragma once

#include <atomic>
#include <string>
#include <vector>

#include "common/image/Image.h"

namespace smartsurf::view {

// An experiment with its picture, the tile of that number of StartContents::tiles.
struct GalleryItem {
  std::string section, file, title;
};

struct StartContents {
  std::vector<GalleryItem> items;  // those of a section stand together
  common::Image tiles;             // row by row, kTileColumns beside each other; empty: no pictures
  std::vector<std::string> recent;
  std::string message;  // one line, or ""
};
inline constexpr int kTileColumns = 8, kTileWidth = 240, kTileHeight = 150;

// Shows the window until the user chooses an experiment or a recording, closes it ("") or `stop` is set ("").
// Throws std::runtime_error, one line, if there is no display or no OpenGL 3.3.
std::string choose_file(const StartContents& contents, const std::atomic<bool>& stop);

}  // namespace smartsurf::view
