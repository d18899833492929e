#include "smartsurf/record/FrameSeries.h"

#include <algorithm>
#include <cstring>
#include <functional>
#include <numeric>

namespace smartsurf::record {
namespace {

std::size_t product(const std::vector<hsize_t>& sizes) {
  return std::accumulate(sizes.begin(), sizes.end(), std::size_t{1}, std::multiplies<>());
}

std::vector<hsize_t> with_frames(hsize_t frames, const std::vector<hsize_t>& row) {
  std::vector<hsize_t> all{frames};
  all.insert(all.end(), row.begin(), row.end());
  return all;
}

Handle create(hid_t parent, const std::string& name, const FrameSeries::Layout& layout) {
  std::vector<hsize_t> chunk = with_frames(layout.chunk_frames, layout.row);
  std::vector<hsize_t> most = with_frames(H5S_UNLIMITED, layout.row);
  if (layout.chunk_columns != 0) {
    chunk[1] = layout.chunk_columns;
    most[1] = H5S_UNLIMITED;
  }
  const std::vector<hsize_t> now = with_frames(0, layout.row);
  const Handle space(H5Screate_simple(static_cast<int>(now.size()), now.data(), most.data()), H5Sclose, name);
  const Handle properties = chunked(chunk);
  check(H5Pset_fill_value(properties, layout.type, layout.fill.data()), name);
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
      row_elements_(product(layout_.row)),
      dataset_(create(parent, name, layout_)) {
  fill_buffer();
}

void FrameSeries::fill_buffer() {
  buffer_.resize(buffer_frames_ * row_bytes());
  const std::size_t size = layout_.fill.size();
  for (std::size_t at = 0; at < buffer_.size(); at += size)
    std::memcpy(buffer_.data() + at, layout_.fill.data(), size);
}

void FrameSeries::grow(hsize_t columns) {
  const std::vector<std::byte> old = buffer_;
  const std::size_t old_bytes = row_bytes();
  layout_.row.front() = columns;
  row_elements_ = product(layout_.row);
  fill_buffer();
  for (std::size_t frame = 0; frame < buffer_frames_ && old_bytes > 0; ++frame)
    std::memcpy(buffer_.data() + frame * row_bytes(), old.data() + frame * old_bytes, old_bytes);
}

std::uint64_t FrameSeries::most_bytes() const {
  const auto up = [](std::uint64_t n, std::uint64_t step) { return (n + step - 1) / step * step; };
  const std::uint64_t columns = layout_.chunk_columns == 0 ? 1 : layout_.row.front();
  const std::uint64_t stored_columns = up(columns, std::max<std::uint64_t>(layout_.chunk_columns, 1));
  const std::uint64_t row = columns == 0 ? 0 : row_bytes() / columns * stored_columns;
  const std::uint64_t frames = up(buffer_frames_, layout_.chunk_frames) + layout_.chunk_frames;
  return row * frames + row * frames / 64;  // packing may make noise a little longer
}

void FrameSeries::write(hsize_t first, hsize_t count, hsize_t from, hsize_t to) {
  const std::vector<hsize_t> extent = with_frames(first + count, layout_.row);
  check(H5Dset_extent(dataset_, extent.data()), name_);
  if (layout_.chunk_columns != 0 && from >= to) return;  // no column has a value

  std::vector<hsize_t> start(extent.size(), 0);
  std::vector<hsize_t> size = with_frames(count, layout_.row);
  std::vector<hsize_t> whole = with_frames(buffer_frames_, layout_.row);
  if (layout_.chunk_columns != 0) {
    start[1] = from;
    size[1] = to - from;
  }
  const int rank = static_cast<int>(extent.size());
  const Handle memory(H5Screate_simple(rank, whole.data(), nullptr), H5Sclose, name_);
  check(H5Sselect_hyperslab(memory, H5S_SELECT_SET, start.data(), nullptr, size.data(), nullptr), name_);
  start[0] = first;
  const Handle file(H5Dget_space(dataset_), H5Sclose, name_);
  check(H5Sselect_hyperslab(file, H5S_SELECT_SET, start.data(), nullptr, size.data(), nullptr), name_);
  check(H5Dwrite(dataset_, layout_.type, memory, file, H5P_DEFAULT, buffer_.data()), name_);
}

}  // namespace smartsurf::record
