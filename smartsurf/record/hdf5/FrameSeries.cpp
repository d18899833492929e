#include "smartsurf/record/hdf5/FrameSeries.h"

#include <algorithm>
#include <cstring>
#include <functional>
#include <numeric>

namespace smartsurf::record {
namespace {

std::size_t element_count(const std::vector<hsize_t>& sizes) {
  return std::accumulate(sizes.begin(), sizes.end(), std::size_t{1}, std::multiplies<>());
}

std::vector<hsize_t> frame_extent(hsize_t frames, const std::vector<hsize_t>& row) {
  std::vector<hsize_t> all{frames};
  all.insert(all.end(), row.begin(), row.end());
  return all;
}

Handle create_series_dataset(hid_t parent, const std::string& name, const FrameSeries::Layout& layout) {
  std::vector<hsize_t> chunk = frame_extent(layout.chunk_frames, layout.row);
  std::vector<hsize_t> max_extent = frame_extent(H5S_UNLIMITED, layout.row);
  if (layout.chunk_columns != 0) {
    chunk[1] = layout.chunk_columns;
    max_extent[1] = H5S_UNLIMITED;
  }
  const std::vector<hsize_t> initial_extent = frame_extent(0, layout.row);
  const Handle space(
      H5Screate_simple(static_cast<int>(initial_extent.size()), initial_extent.data(), max_extent.data()),
      H5Sclose, name);
  const Handle properties = chunked_properties(chunk);
  check(H5Pset_fill_value(properties, layout.type, layout.fill_value.data()), name);
  if (layout.compress) {
    check(H5Pset_shuffle(properties), name);
    check(H5Pset_deflate(properties, 1), name);
  }
  return create_dataset(parent, name.c_str(), layout.type, space, properties);
}

}  // namespace

FrameSeries::FrameSeries(hid_t parent, const std::string& name, Layout layout, std::size_t buffer_frames)
    : name_(name),
      layout_(std::move(layout)),
      buffer_frames_(buffer_frames),
      row_elements_(element_count(layout_.row)),
      dataset_(create_series_dataset(parent, name, layout_)) {
  fill_buffer();
}

void FrameSeries::fill_buffer() {
  buffer_.resize(buffer_frames_ * row_bytes());
  const std::size_t size = layout_.fill_value.size();
  for (std::size_t offset = 0; offset < buffer_.size(); offset += size)
    std::memcpy(buffer_.data() + offset, layout_.fill_value.data(), size);
}

void FrameSeries::grow_columns(hsize_t columns) {
  const std::vector<std::byte> old = buffer_;
  const std::size_t old_bytes = row_bytes();
  layout_.row.front() = columns;
  row_elements_ = element_count(layout_.row);
  fill_buffer();
  for (std::size_t frame = 0; frame < buffer_frames_ && old_bytes > 0; ++frame)
    std::memcpy(buffer_.data() + frame * row_bytes(), old.data() + frame * old_bytes, old_bytes);
}

std::uint64_t FrameSeries::max_bytes() const {
  const auto round_up = [](std::uint64_t n, std::uint64_t step) { return (n + step - 1) / step * step; };
  const std::uint64_t columns = layout_.chunk_columns == 0 ? 1 : layout_.row.front();
  const std::uint64_t stored_columns = round_up(columns, std::max<std::uint64_t>(layout_.chunk_columns, 1));
  const std::uint64_t stored_row_bytes = columns == 0 ? 0 : row_bytes() / columns * stored_columns;
  const std::uint64_t frames = round_up(buffer_frames_, layout_.chunk_frames) + layout_.chunk_frames;
  // Incompressible data grows slightly when compressed.
  return stored_row_bytes * frames + stored_row_bytes * frames / 64;
}

std::uint64_t FrameSeries::stored_bytes(hsize_t first, hsize_t count) const {
  std::uint64_t sum = 0;
  std::vector<hsize_t> chunk(1 + layout_.row.size(), 0);
  for (chunk[0] = first; chunk[0] < first + count; chunk[0] += layout_.chunk_frames) {
    hsize_t bytes = 0;
    check(H5Dget_chunk_storage_size(dataset_, chunk.data(), &bytes), name_);
    sum += bytes;
  }
  return sum;
}

void FrameSeries::write(hsize_t first, hsize_t count, hsize_t column_begin, hsize_t column_end) {
  const std::vector<hsize_t> extent = frame_extent(first + count, layout_.row);
  check(H5Dset_extent(dataset_, extent.data()), name_);
  if (layout_.chunk_columns != 0 && column_begin >= column_end) return;  // all columns are fill values

  std::vector<hsize_t> start(extent.size(), 0);
  std::vector<hsize_t> size = frame_extent(count, layout_.row);
  std::vector<hsize_t> buffer_extent = frame_extent(buffer_frames_, layout_.row);
  if (layout_.chunk_columns != 0) {
    start[1] = column_begin;
    size[1] = column_end - column_begin;
  }
  const int rank = static_cast<int>(extent.size());
  const Handle memory(H5Screate_simple(rank, buffer_extent.data(), nullptr), H5Sclose, name_);
  check(H5Sselect_hyperslab(memory, H5S_SELECT_SET, start.data(), nullptr, size.data(), nullptr), name_);
  start[0] = first;
  const Handle file(H5Dget_space(dataset_), H5Sclose, name_);
  check(H5Sselect_hyperslab(file, H5S_SELECT_SET, start.data(), nullptr, size.data(), nullptr), name_);
  check(H5Dwrite(dataset_, layout_.type, memory, file, H5P_DEFAULT, buffer_.data()), name_);
}

}  // namespace smartsurf::record
