// A dataset that grows by one row per frame, with a write buffer of rows. Internal to this module.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "smartsurf/record/hdf5/Hdf5.h"

namespace smartsurf::record {

class FrameSeries {
 public:
  struct Layout {
    hid_t type = -1;                // of an element, in memory and in the file
    std::vector<hsize_t> row = {};  // extents of a row: {} a scalar, {objects, 3}, {rows, columns}, …
    hsize_t chunk_frames = 1;       // rows stored together
    hsize_t chunk_columns = 0;      // not 0: the row's first axis may grow, and is stored in such pieces
    bool compress = false;          // gzip-1 + shuffle
    std::vector<std::byte> fill_value = {};  // the element that stands for "no value"
  };
  template <class Number>
  static std::vector<std::byte> to_bytes(const Number& number) {
    const auto* first = reinterpret_cast<const std::byte*>(&number);
    return {first, first + sizeof number};
  }

  // buffer_frames: rows that the buffer holds.
  FrameSeries(hid_t parent, const std::string& name, Layout layout, std::size_t buffer_frames);

  // The buffer's row number `buffered`, as elements; a row holds what was last put there.
  template <class Number>
  std::span<Number> row(std::size_t buffer_index) {
    return {reinterpret_cast<Number*>(buffer_.data() + buffer_index * row_bytes()), row_elements_};
  }
  // The most that writing a full buffer can add to the file.
  std::uint64_t max_bytes() const;
  // Makes the row's first axis longer; buffered rows keep their values, and get the fill value behind them.
  void grow_columns(hsize_t columns);
  // Appends the buffer's first `count` rows as the frames [first, first + count). Of rows with a growing axis
  // only the columns [from, to) are written; the others stay "no value".
  void write(hsize_t first, hsize_t count, hsize_t column_begin = 0, hsize_t column_end = 0);

 private:
  std::size_t row_bytes() const { return row_elements_ * layout_.fill_value.size(); }
  void fill_buffer();

  std::string name_;
  Layout layout_;
  std::size_t buffer_frames_, row_elements_;
  std::vector<std::byte> buffer_;  // buffer_frames × row
  Handle dataset_;
};

}  // namespace smartsurf::record
