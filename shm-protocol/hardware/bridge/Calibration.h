// The calibration of a table: what `surface_bridge calibrate` has fitted for each cell, its file, and its use
// by the bridge.
#pragma once

#include <algorithm>
#include <cstdint>
#include <filesystem>
#include <map>
#include <span>
#include <string>
#include <vector>

#include "shm-protocol/hardware/bridge/CellModel.h"
#include "shm-protocol/hardware/bridge/TableFile.h"
#include "shm-protocol/hardware/bridge/TableMap.h"

namespace hardware {

// True if the calibration file of a table whose actuator has this range can hold the fit.
bool is_usable(const CellFit&, double range);

class Calibration {
 public:
  // Where a board was when it was calibrated.
  struct Place {
    std::string id;
    std::uint32_t row = 0, column = 0;
    int turn = 0;
    bool mirror = false;
    std::size_t line = 0;  // of the file; 0: none
  };

  // Throws std::invalid_argument with one line that names file, line, key and value.
  static Calibration read(const std::filesystem::path&);
  // The file's text.
  std::string text() const;

  // Throws std::invalid_argument likewise if the calibration is of another table.
  void require_table(const TableSpec&) const;
  void require_map(const TableMap&);

  // Subtracts the sensors' zeros from the readings of a board's cells. `readings`: the sensor's plane, by the
  // table's cells.
  void correct_readings(const MountedBoard&, std::span<float> readings) const;
  // Replaces the heights of a board's cells by the commands under which they reach them:
  // (height - zero ± play / 2) / slope, with + if the cell's height rose last. `heights`: the actuator's
  // plane.
  void correct_commands(const MountedBoard&, std::span<float> heights);
  // The board's cells stand where this command of its own has brought them.
  void note_own_command(const MountedBoard&, float command);

  std::size_t cells() const { return std::size_t{rows} * columns; }
  std::size_t present_cells() const {
    return cells() - static_cast<std::size_t>(std::ranges::count(fits, CellState::kAbsent, &CellFit::state));
  }

  std::string file, table, actuator, sensor, unit;
  std::uint32_t rows = 0, columns = 0, period_us = 0;
  bool has_rest = false;  // the zero of the sensors was measured
  std::vector<Place> boards;
  std::map<std::string, std::size_t> lines;  // of the file, by key; none: it was not read from a file
  std::vector<CellFit> fits;                 // by the table's cells

 private:
  std::size_t line_of(const std::string& key) const;  // 0: none
  // "FILE:LINE: ", or "FILE: " of line 0.
  std::string place(std::size_t line) const;

  void note_height(std::size_t cell, float height);

  std::vector<float> last_;           // heights
  std::vector<std::int8_t> upwards_;  // 1 or -1: where the height went last; 0: nowhere yet
};

// A line for each cell that someone with a screwdriver should look at: it does not answer, does not reach the
// ends of the range, from `lowest` to `highest`, or is far from the other cells.
std::vector<std::string> cells_to_adjust(const Calibration&, double lowest, double highest);

// A map of the states and of each parameter, as SVG.
std::string calibration_maps(const Calibration&);

}  // namespace hardware
