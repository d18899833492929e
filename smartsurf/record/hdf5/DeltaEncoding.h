// Delta encoding of rows of numbers that change little from frame to frame. Internal to this module.
//
// The datasets are `end` (per row: number of changes up to and including it), `cell` and `value` (per change:
// the index within the row and the new value). The first row lists every value.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "smartsurf/record/hdf5/Hdf5.h"

namespace smartsurf::record {

class DeltaWriter {
 public:
  // Creates the group `name` in `parent`, for rows of `row_size` numbers.
  DeltaWriter(hid_t parent, const char* name, std::size_t row_size);

  // A row is any number of add() calls, each with the index of its first value within the row, followed by
  // end_row(). Allocates only in the first rows and when more changes are buffered than ever before.
  void add(std::span<const float> values, std::size_t offset);
  void end_row() { row_ends_.push_back(written_changes_ + cells_.size()); }
  std::size_t buffered_changes() const { return cells_.size(); }

  std::uint64_t max_bytes() const;  // upper bound of the bytes that write() adds to the file
  void write();                     // writes the buffered changes, then their row ends

 private:
  Handle group_, row_end_dataset_, cell_dataset_, value_dataset_;
  std::vector<float> previous_row_;
  std::vector<std::uint64_t> row_ends_;
  std::vector<std::uint32_t> cells_;
  std::vector<float> values_;
  std::uint64_t written_rows_ = 0, written_changes_ = 0;
};

class DeltaReader {
 public:
  // Throws Hdf5Error if the group's datasets are inconsistent.
  DeltaReader(hid_t parent, const char* name, std::size_t row_size);

  std::size_t rows() const { return row_ends_.size(); }
  // The values of a row, valid until the next call. Applies the changes since the previously read row; when
  // going back, those since the nearest keyframe.
  std::span<const float> read_row(std::size_t row);

 private:
  void restore_keyframe(std::size_t row);
  void apply(std::uint64_t from, std::uint64_t to);
  void load_block(std::uint64_t change);

  std::string name_;
  Handle group_, cell_dataset_, value_dataset_;
  std::vector<std::uint64_t> row_ends_;
  std::vector<float> current_row_;
  std::size_t next_row_ = 0;  // current_row_ holds the row before it
  std::size_t keyframe_interval_ = 1;
  std::vector<std::vector<float>> keyframes_;  // complete rows, one every keyframe_interval_
  std::uint64_t block_begin_ = 0;
  std::vector<std::uint32_t> block_cells_;
  std::vector<float> block_values_;
};

}  // namespace smartsurf::record
