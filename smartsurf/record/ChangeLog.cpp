#include "smartsurf/record/ChangeLog.h"

#include <algorithm>
#include <bit>
#include <cassert>

#include "smartsurf/record/Hdf5Reading.h"

namespace smartsurf::record {
namespace {

constexpr hsize_t kChunkChanges = 8192, kChunkRows = 1024;
constexpr std::uint64_t kBlockChanges = 1u << 16;  // read at once
constexpr std::size_t kLeastRowsBetweenKept = 256, kMostKeptBytes = std::size_t{64} << 20;
constexpr std::uint64_t kMostPacked = 1100 / sizeof(std::uint32_t);  // changes a stored byte, at most

Handle growing(hid_t group, const char* name, hid_t type, hsize_t chunk, bool compress) {
  const hsize_t now = 0, most = H5S_UNLIMITED;
  const Handle space(H5Screate_simple(1, &now, &most), H5Sclose, name);
  const Handle properties = chunked({chunk});
  if (compress) {
    check(H5Pset_shuffle(properties), name);
    check(H5Pset_deflate(properties, 1), name);
  }
  return create_dataset(group, name, type, space, properties);
}

template <class Number>
void append(hid_t dataset, const char* name, hid_t type, hsize_t written, std::vector<Number>& values) {
  const hsize_t count = values.size(), extent = written + count;
  if (count == 0) return;
  check(H5Dset_extent(dataset, &extent), name);
  const Handle file(H5Dget_space(dataset), H5Sclose, name);
  check(H5Sselect_hyperslab(file, H5S_SELECT_SET, &written, nullptr, &count, nullptr), name);
  const Handle memory(H5Screate_simple(1, &count, nullptr), H5Sclose, name);
  check(H5Dwrite(dataset, type, memory, file, H5P_DEFAULT, values.data()), name);
  values.clear();
}

}  // namespace

ChangeWriter::ChangeWriter(hid_t parent, const char* name, std::size_t cells)
    : group_(create_group(parent, name)),
      end_set_(growing(group_, "end", H5T_NATIVE_UINT64, kChunkRows, false)),
      cell_set_(growing(group_, "cell", H5T_NATIVE_UINT32, kChunkChanges, true)),
      value_set_(growing(group_, "value", H5T_NATIVE_FLOAT, kChunkChanges, true)),
      last_(cells) {
  cell_.reserve(4 * cells);
  value_.reserve(4 * cells);
}

void ChangeWriter::add(std::span<const float> part, std::size_t first) {
  assert(first + part.size() <= last_.size());
  const bool all = written_rows_ == 0 && end_.empty();
  for (std::size_t i = 0; i < part.size(); ++i) {
    float& last = last_[first + i];
    // By bits: a NaN is equal to itself, and −0 differs from 0.
    if (!all && std::bit_cast<std::uint32_t>(last) == std::bit_cast<std::uint32_t>(part[i])) continue;
    last = part[i];
    cell_.push_back(static_cast<std::uint32_t>(first + i));
    value_.push_back(part[i]);
  }
}

std::uint64_t ChangeWriter::most_bytes() const {
  // Two chunks more than the data fills: the one begun before is stored anew, and so is the one not yet full.
  const auto stored = [](std::uint64_t count, std::uint64_t chunk, std::uint64_t bytes) {
    return (count / chunk + 3) * chunk * bytes;
  };
  const std::uint64_t changes = stored(cell_.size(), kChunkChanges, 8);
  return changes + changes / 64 + stored(end_.size(), kChunkRows, 8);
}

void ChangeWriter::write() {
  const std::uint64_t changes = cell_.size(), rows = end_.size();
  append(cell_set_, "cell", H5T_NATIVE_UINT32, written_changes_, cell_);
  append(value_set_, "value", H5T_NATIVE_FLOAT, written_changes_, value_);
  append(end_set_, "end", H5T_NATIVE_UINT64, written_rows_, end_);
  written_changes_ += changes;
  written_rows_ += rows;
}

ChangeReader::ChangeReader(hid_t parent, const char* name, std::size_t cells)
    : name_(name),
      group_(open_group(parent, name)),
      cell_set_(open_dataset(group_, "cell", 1)),
      value_set_(open_dataset(group_, "value", 1)) {
  const Handle ends = open_dataset(group_, "end", 1);
  end_ = read_block<std::uint64_t>(ends, H5T_NATIVE_UINT64, {0}, {stored_entries(ends, 8)}, name_ + "/end");
  const std::uint64_t changes = std::min(extents(cell_set_)[0], extents(value_set_)[0]);
  // An extent may claim anything, but nothing packs better than a thousandfold.
  if (changes / kMostPacked > H5Dget_storage_size(cell_set_) + kChunkChanges)
    throw Hdf5Error("dataset " + name_ + "/cell claims more than it holds");
  // A kill in the middle of a write may leave rows whose changes are not there.
  while (!end_.empty() && end_.back() > changes) end_.pop_back();
  std::uint64_t before = 0;
  for (std::size_t row = 0; row < end_.size(); before = end_[row++])
    if (end_[row] < before || end_[row] - before > cells || (row == 0 && end_[row] != cells))
      throw Hdf5Error("dataset " + name_ + "/end: row " + std::to_string(row) + " cannot be");
  if (!end_.empty()) values_.resize(cells);
  rows_between_kept_ = std::max(kLeastRowsBetweenKept, rows() * cells / (kMostKeptBytes / sizeof(float)) + 1);
}

std::span<const float> ChangeReader::at(std::size_t row) {
  if (row >= rows()) throw Hdf5Error(name_ + " has no row " + std::to_string(row));
  if (next_row_ > row + 1) go_back(row);
  while (next_row_ <= row) {
    apply(next_row_ == 0 ? 0 : end_[next_row_ - 1], end_[next_row_]);
    if (next_row_ % rows_between_kept_ == 0 && next_row_ / rows_between_kept_ == kept_.size())
      kept_.push_back(values_);
    ++next_row_;
  }
  return values_;
}

void ChangeReader::go_back(std::size_t row) {
  const std::size_t kept = row / rows_between_kept_;
  values_ = kept_.at(kept);
  next_row_ = kept * rows_between_kept_ + 1;
}

void ChangeReader::load_block(std::uint64_t change) {
  const std::uint64_t count = std::min(kBlockChanges, end_.back() - change);
  block_cell_ = read_block<std::uint32_t>(cell_set_, H5T_NATIVE_UINT32, {change}, {count}, name_ + "/cell");
  block_value_ = read_block<float>(value_set_, H5T_NATIVE_FLOAT, {change}, {count}, name_ + "/value");
  block_first_ = change;
}

void ChangeReader::apply(std::uint64_t from, std::uint64_t to) {
  for (std::uint64_t change = from; change < to; ++change) {
    if (change < block_first_ || change >= block_first_ + block_cell_.size()) load_block(change);
    const std::uint32_t cell = block_cell_[change - block_first_];
    if (cell >= values_.size())
      throw Hdf5Error("dataset " + name_ + "/cell: there is no cell " + std::to_string(cell));
    values_[cell] = block_value_[change - block_first_];
  }
}

}  // namespace smartsurf::record
