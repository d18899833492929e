// One cell with its eight neighbours, through all registers and the latest ticks.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "apron/vm/Vm.h"

namespace apron::debugger {

// Row by row from the north-west; [4] is the cell itself. NaN beyond the edge.
using Neighbourhood = std::array<float, 9>;

struct Cell {
  std::uint32_t x = 0, y = 0;  // column and row

  bool operator==(const Cell&) const = default;
};

// By register, as the program numbers them.
std::vector<Neighbourhood> read_neighbourhoods(const vm::Vm& vm, const Cell& cell);

// What the cell held at the end of each tick.
class Probe {
 public:
  static constexpr std::size_t kMaxRecords = 128;

  struct Record {
    std::uint64_t tick = 0;
    std::vector<float> values;  // by register; NaN where it has no such cell
  };

  // Forgets what another cell held.
  void select_cell(const Cell& cell);
  const Cell& cell() const noexcept { return cell_; }
  void record(const vm::Vm& vm, std::uint64_t tick);
  void clear() { records_.clear(); }
  // The oldest first, at most kTicks.
  std::vector<Record> records() const;

 private:
  Cell cell_;
  std::vector<Record> records_;  // a ring once it is full
  std::size_t next_ = 0;
};

}  // namespace apron::debugger
