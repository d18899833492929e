#include "smartsurf/web/SeriesEncoder.h"

#include <gtest/gtest.h>
#include <zlib.h>

#include <cmath>

#include "smartsurf/web/Base64.h"

namespace smartsurf::web {
namespace {

// Decodes like player.js.
std::vector<double> decode(const SeriesEncoder& encoder, std::size_t frames) {
  const SeriesLayout& layout = encoder.layout();
  const std::size_t n = layout.values_per_frame;
  const auto bytes = static_cast<unsigned>(layout.bytes_per_value);
  const unsigned no_value = 0xFFFFFFFFU >> (32 - 8 * bytes);
  std::vector<double> values;
  std::vector<unsigned> current(n);
  for (std::size_t f = 0; f < frames; ++f)
    for (std::size_t i = 0; i < n; ++i) {
      const std::uint8_t* const frame = encoder.bytes().data() + f * n * bytes;
      unsigned delta = 0;
      for (unsigned b = 0; b < bytes; ++b) delta |= unsigned{frame[b * n + i]} << 8 * b;
      current[i] = (current[i] + delta) & no_value;
      values.push_back(current[i] == no_value
                           ? NAN
                           : layout.low + current[i] * (layout.high - layout.low) / (no_value - 1));
    }
  return values;
}

TEST(SeriesEncoder, RoundsToNearestCode) {
  for (const int bytes : {1, 2, 4}) {
    SeriesEncoder packer({-15.0, 30.0, bytes, 3});
    std::vector<float> all;
    for (int f = 0; f < 50; ++f) {
      const std::vector<float> frame = {20.0f * std::sin(0.3f * static_cast<float>(f)) + 9.0f, -15.0f,
                                        f % 2 ? 30.0f : NAN};
      packer.add(frame);
      all.insert(all.end(), frame.begin(), frame.end());
    }
    const std::vector<double> read = decode(packer, 50);
    ASSERT_EQ(read.size(), all.size());
    const double half_step = 0.5 * 45.0 / (std::exp2(8 * bytes) - 2.0);
    for (std::size_t i = 0; i < all.size(); ++i)
      if (std::isnan(all[i]))
        EXPECT_TRUE(std::isnan(read[i])) << i;
      else
        EXPECT_NEAR(read[i], all[i], half_step * 1.01) << i;
  }
}

TEST(SeriesEncoder, ClampsToRange) {
  SeriesEncoder packer({0.0, 1.0, 2, 2});
  packer.add(std::vector<float>{-5.0f, 7.0f});
  EXPECT_EQ(decode(packer, 1), (std::vector<double>{0.0, 1.0}));
}

TEST(SeriesEncoder, CompressedDataIsZlib) {
  const std::vector<std::uint8_t> bytes(100'000, 7);
  const std::vector<std::uint8_t> packed = compress(bytes);
  EXPECT_LT(packed.size(), 1000u);
  std::vector<std::uint8_t> back(bytes.size());
  uLongf length = back.size();
  ASSERT_EQ(uncompress(back.data(), &length, packed.data(), packed.size()), Z_OK);
  EXPECT_EQ(back, bytes);
}

TEST(SeriesEncoder, EncodesBase64) {
  const auto text = [](std::string_view bytes) {
    return base64({reinterpret_cast<const std::uint8_t*>(bytes.data()), bytes.size()});
  };
  EXPECT_EQ(text(""), "");
  EXPECT_EQ(text("M"), "TQ==");
  EXPECT_EQ(text("Ma"), "TWE=");
  EXPECT_EQ(text("Man"), "TWFu");
  EXPECT_EQ(text("\xff\xfe\xfd\xfc"), "//79/A==");
}

}  // namespace
}  // namespace smartsurf::web
