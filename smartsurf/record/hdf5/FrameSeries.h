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
    hid_t type = -1;                // element type, in memory and in the file
    std::vector<hsize_t> row = {};  // extents of a row: {} for a scalar, {objects, 3}, {rows, columns}, …
    hsize_t chunk_frames = 1;       // rows per chunk
    hsize_t chunk_columns = 0;      // columns per chunk if the row's first axis can grow; 0 if it is fixed
    bool compress = false;          // gzip-1 + shuffle
    std::vector<std::byte> fill_value = {};  // bytes of the element that means "no value"
  };
  template <class Number>
  static std::vector<std::byte> to_bytes(const Number& number) {
    const auto* first = reinterpret_cast<const std::byte*>(&number);
    return {first, first + sizeof number};
  }

  // buffer_frames: capacity of the buffer, rows.
  FrameSeries(hid_t parent, const std::string& name, Layout layout, std::size_t buffer_frames);

  // A row of the buffer; it keeps its values until they are overwritten.
  template <class Number>
  std::span<Number> row(std::size_t buffer_index) {
    return {reinterpret_cast<Number*>(buffer_.data() + buffer_index * row_bytes()), row_elements_};
  }
  hid_t dataset() const { return dataset_; }
  // Upper bound of the bytes that writing a full buffer adds to the file.
  std::uint64_t max_bytes() const;
  // Bytes in the file of the chunks with the frames [first, first + count), which are written and flushed.
  // `first` begins a chunk. Only if the row's first axis is fixed.
  std::uint64_t stored_bytes(hsize_t first, hsize_t count) const;
  // Extends the row's first axis; buffered rows keep their values and are padded with the fill value.
  void grow_columns(hsize_t columns);
  // Writes the buffer's first `count` rows as the frames [first, first + count). If the row's first axis can
  // grow, writes only the columns [column_begin, column_end); the others keep the fill value.
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
