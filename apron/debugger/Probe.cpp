#include "apron/debugger/Probe.h"

#include <algorithm>
#include <limits>

namespace apron::debugger {
namespace {

float value_or_nan(const vm::Plane& plane, std::int64_t x, std::int64_t y) {
  if (x < 0 || y < 0 || x >= plane.width || y >= plane.height) return std::numeric_limits<float>::quiet_NaN();
  return vm::cell_as_float(plane, static_cast<std::uint32_t>(x), static_cast<std::uint32_t>(y));
}

}  // namespace

std::vector<Neighbourhood> read_neighbourhoods(const vm::Vm& vm, const Cell& cell) {
  std::vector<Neighbourhood> all(vm.program().registers.size());
  for (std::size_t r = 0; r < all.size(); ++r)
    for (std::int64_t i = 0; i < 9; ++i)
      all[r][i] =
          value_or_nan(vm.plane(r), std::int64_t{cell.x} + i % 3 - 1, std::int64_t{cell.y} + i / 3 - 1);
  return all;
}

void Probe::select_cell(const Cell& cell) {
  if (cell == cell_) return;
  cell_ = cell;
  records_.clear();
  next_ = 0;
}

void Probe::record(const vm::Vm& vm, std::uint64_t tick) {
  if (records_.size() < kMaxRecords) {
    next_ = records_.size();
    records_.emplace_back();
  }
  Record& entry = records_[next_];
  next_ = (next_ + 1) % kMaxRecords;
  entry.tick = tick;
  entry.values.resize(vm.program().registers.size());
  for (std::size_t r = 0; r < entry.values.size(); ++r)
    entry.values[r] = value_or_nan(vm.plane(r), cell_.x, cell_.y);
}

std::vector<Probe::Record> Probe::records() const {
  if (records_.size() < kMaxRecords) return records_;
  std::vector<Record> all(records_.size());
  std::rotate_copy(records_.begin(), records_.begin() + next_, records_.end(), all.begin());
  return all;
}

}  // namespace apron::debugger
