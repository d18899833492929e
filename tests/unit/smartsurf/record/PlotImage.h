// The pixels of a figure.
#pragma once

#include <cairo.h>
#include <gtest/gtest.h>

#include <cstdint>
#include <filesystem>

namespace smartsurf::record {

class Image {
 public:
  explicit Image(const std::filesystem::path& path)
      : surface_(cairo_image_surface_create_from_png(path.c_str())) {
    EXPECT_EQ(cairo_surface_status(surface_), CAIRO_STATUS_SUCCESS);
  }
  ~Image() { cairo_surface_destroy(surface_); }
  int width() const { return cairo_image_surface_get_width(surface_); }
  int height() const { return cairo_image_surface_get_height(surface_); }
  // The pixel, 0xRRGGBB, at a position in points.
  std::uint32_t pixel_at(double x, double y) const {
    const int column = static_cast<int>(2.0 * x), row = static_cast<int>(2.0 * y);
    const unsigned char* line =
        cairo_image_surface_get_data(surface_) + row * cairo_image_surface_get_stride(surface_);
    return reinterpret_cast<const std::uint32_t*>(line)[column] & 0xFFFFFFu;
  }
  // True if blue clearly dominates red, and vice versa.
  bool is_blue(double x, double y) const { return (pixel_at(x, y) & 0xFF) > (pixel_at(x, y) >> 16) + 80; }
  bool is_orange(double x, double y) const { return (pixel_at(x, y) >> 16) > (pixel_at(x, y) & 0xFF) + 80; }

 private:
  cairo_surface_t* surface_;
};

}  // namespace smartsurf::record
