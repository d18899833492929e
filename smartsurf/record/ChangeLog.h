// A row of numbers that mostly stays as it is, kept as what changed: `end` (one entry a row: how many changes
// belong to rows up to this one), `cell` and `value` (one entry a change). The first row lists every value.
// Private to the room.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "smartsurf/record/Hdf5.h"

namespace smartsurf::record {

class ChangeWriter {
 public:
  // Makes the group `name` in `parent`, for rows of `cells` numbers.
  ChangeWriter(hid_t parent, const char* name, std::size_t cells);

  // A row: any number of add() for its parts, `first` the place of the part's first value; then end_row().
  // Only the first rows and rows with more changes than ever before allocate.
  void add(std::span<const float> part, std::size_t first);
  void end_row() { end_.push_back(written_changes_ + cell_.size()); }
  std::size_t buffered_changes() const { return cell_.size(); }

  std::uint64_t most_bytes() const;  // that write() can add to the file
  void write();                      // what is buffered; the changes before their rows

 private:
  Handle group_, end_set_, cell_set_, value_set_;
  std::vector<float> last_;
  std::vector<std::uint64_t> end_;
  std::vector<std::uint32_t> cell_;
  std::vector<float> value_;
  std::uint64_t written_rows_ = 0, written_changes_ = 0;
};

class ChangeReader {
 public:
  // Throws Hdf5Error when the group's datasets do not fit together.
  ChangeReader(hid_t parent, const char* name, std::size_t cells);

  std::size_t rows() const { return end_.size(); }
  // The values of a row, valid until the next call. Costs the changes since the row asked for last, or, going
  // back, since one of the whole rows that are kept on the way.
  std::span<const float> at(std::size_t row);

 private:
  void go_back(std::size_t row);
  void apply(std::uint64_t from, std::uint64_t to);
  void load_block(std::uint64_t change);

  std::string name_;
  Handle group_, cell_set_, value_set_;
  std::vector<std::uint64_t> end_;
  std::vector<float> values_;
  std::size_t next_row_ = 0;  // values_ holds the row before it
  std::size_t rows_between_kept_ = 1;
  std::vector<std::vector<float>> kept_;  // whole rows, one in so many
  std::uint64_t block_first_ = 0;
  std::vector<std::uint32_t> block_cell_;
  std::vector<float> block_value_;
};

}  // namespace smartsurf::record
