// The file of a table: which boards it has, where they are, and how they are mounted.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "shm-protocol/hardware/bridge/Port.h"

namespace hardware {

struct TableBoard {
  std::string id;  // that the board must have; "": any
  PortAddress port;
  std::uint32_t row = 0, column = 0;  // in the table, of the north-west cell of the mounted board
  int turn = 0;                       // counter-clockwise from above: 0, 90, 180, 270
  bool mirror = false;                // west and east swapped, before the turn
  // Rows and columns of the board itself; nothing: it must be there at the start.
  std::optional<std::pair<std::uint32_t, std::uint32_t>> size;
  std::vector<std::string> without;  // channels of the board that the table does not use
  std::size_t line = 0;              // of the file

  // The name of the board in messages.
  std::string title() const { return id.empty() ? port.text : id; }
};

struct TableSpec {
  std::string file, name;
  std::size_t name_line = 0;
  std::optional<double> pitch;  // nothing: that of the boards
  std::uint32_t period_us = 0;
  bool holes = false;                            // cells without a board are allowed
  std::optional<std::string> calibration;        // file of the calibration
  std::vector<std::string> calibrated_channels;  // whose values are real numbers, whatever the boards send
  std::vector<TableBoard> boards;

  // "FILE:LINE: board 'b1': " for messages about a board.
  std::string place(const TableBoard&) const;
};

// Throws std::invalid_argument with one line that names file, line, key and value.
TableSpec read_table(const std::filesystem::path&);

}  // namespace hardware
