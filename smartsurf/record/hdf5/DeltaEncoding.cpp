#include "smartsurf/record/hdf5/DeltaEncoding.h"

#include <algorithm>
#include <bit>
#include <cassert>

#include "smartsurf/record/hdf5/Hdf5Reading.h"

namespace smartsurf::record {
namespace {

constexpr const char *kEnd = "end", *kCell = "cell", *kValue = "value";
constexpr hsize_t kChunkChanges = 8192, kChunkRows = 1024;
constexpr std::uint64_t kBlockChanges = 1u << 16;  // changes read at once
constexpr std::size_t kMinKeyframeInterval = 256, kMaxKeyframeBytes = std::size_t{64} << 20;

template <class Number>
Handle create_growing_dataset(hid_t group, const char* name, hsize_t chunk, bool compress) {
  const hsize_t initial_size = 0, max_size = H5S_UNLIMITED;
  const Handle space(H5Screate_simple(1, &initial_size, &max_size), H5Sclose, name);
  const Handle properties = chunked_properties({chunk});
  if (compress) {
    check(H5Pset_shuffle(properties), name);
    check(H5Pset_deflate(properties, 1), name);
  }
  return create_dataset(group, name, native_type<Number>(), space, properties);
}

template <class Number>
void append_to_dataset(hid_t dataset, const char* name, hsize_t written_count, std::vector<Number>& values) {
  const hsize_t count = values.size(), extent = written_count + count;
  if (count == 0) return;
  check(H5Dset_extent(dataset, &extent), name);
  const Handle file(H5Dget_space(dataset), H5Sclose, name);
  check(H5Sselect_hyperslab(file, H5S_SELECT_SET, &written_count, nullptr, &count, nullptr), name);
  const Handle memory(H5Screate_simple(1, &count, nullptr), H5Sclose, name);
  check(H5Dwrite(dataset, native_type<Number>(), memory, file, H5P_DEFAULT, values.data()), name);
  values.clear();
}

}  // namespace

DeltaWriter::DeltaWriter(hid_t parent, const char* name, std::size_t row_size)
    : group_(create_group(parent, name)),
      row_end_dataset_(create_growing_dataset<std::uint64_t>(group_, kEnd, kChunkRows, false)),
      cell_dataset_(create_growing_dataset<std::uint32_t>(group_, kCell, kChunkChanges, true)),
      value_dataset_(create_growing_dataset<float>(group_, kValue, kChunkChanges, true)),
      previous_row_(row_size) {
  cells_.reserve(4 * row_size);
  values_.reserve(4 * row_size);
}

void DeltaWriter::add(std::span<const float> values, std::size_t offset) {
  assert(offset + values.size() <= previous_row_.size());
  const bool is_first_row = written_rows_ == 0 && row_ends_.empty();
  for (std::size_t i = 0; i < values.size(); ++i) {
    float& previous = previous_row_[offset + i];
    // Compares bits: a NaN equals itself, and −0 differs from 0.
    if (!is_first_row && std::bit_cast<std::uint32_t>(previous) == std::bit_cast<std::uint32_t>(values[i]))
      continue;
    previous = values[i];
    cells_.push_back(static_cast<std::uint32_t>(offset + i));
    values_.push_back(values[i]);
  }
}

std::uint64_t DeltaWriter::max_bytes() const {
  // Up to two chunks beyond the data: the partial chunk at either end is rewritten elsewhere in the file.
  const auto stored_bytes = [](std::uint64_t count, std::uint64_t chunk, std::uint64_t bytes) {
    return (count / chunk + 3) * chunk * bytes;
  };
  const std::uint64_t changes = stored_bytes(cells_.size(), kChunkChanges, 8);
  return changes + changes / 64 + stored_bytes(row_ends_.size(), kChunkRows, 8);
}

void DeltaWriter::write() {
  const std::uint64_t changes = cells_.size(), rows = row_ends_.size();
  append_to_dataset(cell_dataset_, kCell, written_changes_, cells_);
  append_to_dataset(value_dataset_, kValue, written_changes_, values_);
  append_to_dataset(row_end_dataset_, kEnd, written_rows_, row_ends_);
  written_changes_ += changes;
  written_rows_ += rows;
}

DeltaReader::DeltaReader(hid_t parent, const char* name, std::size_t row_size)
    : name_(name),
      group_(open_group(parent, name)),
      cell_dataset_(open_dataset(group_, kCell, 1)),
      value_dataset_(open_dataset(group_, kValue, 1)) {
  const Handle ends = open_dataset(group_, kEnd, 1);
  row_ends_ = read_block<std::uint64_t>(ends, {0}, {stored_entries(ends, 8)}, name_ + "/end");
  const std::uint64_t changes = std::min(extents(cell_dataset_)[0], extents(value_dataset_)[0]);
  require_stored(cell_dataset_, changes, name_ + "/cell");
  // A run killed during a write may leave rows whose changes are missing.
  while (!row_ends_.empty() && row_ends_.back() > changes) row_ends_.pop_back();
  std::uint64_t previous_end = 0;
  for (std::size_t row = 0; row < row_ends_.size(); previous_end = row_ends_[row++])
    if (row_ends_[row] < previous_end || row_ends_[row] - previous_end > row_size ||
        (row == 0 && row_ends_[row] != row_size))
      throw Hdf5Error("dataset " + name_ + "/end: row " + std::to_string(row) + " is invalid");
  if (!row_ends_.empty()) current_row_.resize(row_size);
  keyframe_interval_ =
      std::max(kMinKeyframeInterval, rows() * row_size / (kMaxKeyframeBytes / sizeof(float)) + 1);
}

std::span<const float> DeltaReader::read_row(std::size_t row) {
  if (row >= rows()) throw Hdf5Error(name_ + " has no row " + std::to_string(row));
  if (next_row_ > row + 1) restore_keyframe(row);
  while (next_row_ <= row) {
    apply(next_row_ == 0 ? 0 : row_ends_[next_row_ - 1], row_ends_[next_row_]);
    if (next_row_ % keyframe_interval_ == 0 && next_row_ / keyframe_interval_ == keyframes_.size())
      keyframes_.push_back(current_row_);
    ++next_row_;
  }
  return current_row_;
}

void DeltaReader::restore_keyframe(std::size_t row) {
  const std::size_t keyframe = row / keyframe_interval_;
  current_row_ = keyframes_.at(keyframe);
  next_row_ = keyframe * keyframe_interval_ + 1;
}

void DeltaReader::load_block(std::uint64_t change) {
  const std::uint64_t count = std::min(kBlockChanges, row_ends_.back() - change);
  block_cells_ = read_block<std::uint32_t>(cell_dataset_, {change}, {count}, name_ + "/cell");
  block_values_ = read_block<float>(value_dataset_, {change}, {count}, name_ + "/value");
  block_begin_ = change;
}

void DeltaReader::apply(std::uint64_t from, std::uint64_t to) {
  for (std::uint64_t change = from; change < to; ++change) {
    if (change < block_begin_ || change >= block_begin_ + block_cells_.size()) load_block(change);
    const std::uint32_t cell = block_cells_[change - block_begin_];
    if (cell >= current_row_.size())
      throw Hdf5Error("dataset " + name_ + "/cell: no cell " + std::to_string(cell));
    current_row_[cell] = block_values_[change - block_begin_];
  }
}

}  // namespace smartsurf::record
