// Delta encoding of a row of numbers that changes little from frame to frame: `end` (per row: number of
// changes up to and including it), `cell` and `value` (per change). The first row lists every value. Internal
// to this module.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "smartsurf/record/hdf5/Hdf5.h"

namespace smartsurf::record {

class DeltaWriter {
 public:
  // Makes the group `name` in `parent`, for rows of `cells` numbers.
  DeltaWriter(hid_t parent, const char* name, std::size_t row_size);

  // A row: any number of add() for its parts, `first` the place of the part's first value; then end_row().
  // Only the first rows and rows with more changes than ever before allocate.
  void add(std::span<const float> values, std::size_t offset);
  void end_row() { row_ends_.push_back(written_changes_ + cells_.size()); }
  std::size_t buffered_changes() const { return cells_.size(); }

  std::uint64_t max_bytes() const;  // that write() can add to the file
  void write();                     // what is buffered; the changes before their rows

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
  // Throws Hdf5Error when the group's datasets do not fit together.
  DeltaReader(hid_t parent, const char* name, std::size_t row_size);

  std::size_t rows() const { return row_ends_.size(); }
  // The values of a row, valid until the next call. Costs the changes since the row asked for last, or, going
  // back, since one of the whole rows that are kept on the way.
  std::span<const float> read_row(std::size_t row);

 private:
  void restore_keyframe(std::size_t row);
  void apply(std::uint64_t from, std::uint64_t to);
  void load_block(std::uint64_t change);

  std::string name_;
  Handle group_, cell_dataset_, value_dataset_;
  std::vector<std::uint64_t> row_ends_;
  std::vector<float> current_row_;
  std::size_t next_row_ = 0;  // values_ holds the row before it
  std::size_t keyframe_interval_ = 1;
  std::vector<std::vector<float>> keyframes_;  // whole rows, one in so many
  std::uint64_t block_begin_ = 0;
  std::vector<std::uint32_t> block_cells_;
  std::vector<float> block_values_;
};

}  // namespace smartsurf::record
