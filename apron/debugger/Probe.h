// Records one cell of all registers over the latest ticks, and reads its neighbourhood.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "apron/vm/Vm.h"

namespace apron::debugger {

// The 3x3 cells around a cell, row-major from the north-west; [4] is the cell itself. NaN beyond the edge.
using Neighbourhood = std::array<float, 9>;

struct Cell {
  std::uint32_t x = 0, y = 0;  // column and row

  bool operator==(const Cell&) const = default;
};

// Indexed like Program::registers.
std::vector<Neighbourhood> read_neighbourhoods(const vm::Vm& vm, const Cell& cell);

// The values of one cell at the end of each tick, for the latest kMaxRecords ticks.
class Probe {
 public:
  static constexpr std::size_t kMaxRecords = 512;

  struct Record {
    std::uint64_t tick = 0;
    std::vector<float> values;  // indexed by register; NaN if the cell is outside it
  };

  // Discards the records of another cell.
  void select_cell(const Cell& cell);
  const Cell& cell() const noexcept { return cell_; }
  void record(const vm::Vm& vm, std::uint64_t tick);
  void clear() { records_.clear(); }
  // Oldest first.
  std::vector<Record> records() const;

 private:
  Cell cell_;
  std::vector<Record> records_;  // a ring buffer once full
  std::size_t next_ = 0;         // the slot of the next record, which is the oldest once full
};

}  // namespace apron::debugger
