// Array and image files: round trips, files written by other programs, and one-line errors for invalid files.
#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <cstdint>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <random>

#include "apron/run/host/LocalHost.h"
#include "apron/run/media/ArrayFile.h"
#include "apron/run/media/ImageFile.h"
#include "apron/run/media/MediaError.h"
#include "apron/vm/PlaneStore.h"

namespace apron::run {
namespace {

using vm::HostStatus;
using vm::Plane;

class MediaTest : public testing::Test {
 protected:
  void SetUp() override {
    const auto* test = testing::UnitTest::GetInstance()->current_test_info();
    directory_ = std::filesystem::path(testing::TempDir()) /
                 ("apron_media_" + std::to_string(getpid()) + test->name());
    std::filesystem::remove_all(directory_);
    std::filesystem::create_directories(directory_);
  }
  void TearDown() override { std::filesystem::remove_all(directory_); }

  std::string path(const std::string& name) const { return (directory_ / name).string(); }
  void write_bytes(const std::string& name, const std::string& bytes) const {
    std::ofstream(path(name), std::ios::binary) << bytes;
  }
  Plane plane(std::uint32_t width, std::uint32_t height) { return store_.allocate(width, height); }
  Plane random_plane(std::uint32_t width, std::uint32_t height) {
    const Plane p = plane(width, height);
    std::uniform_real_distribution<float> real(-1e3F, 1e3F);
    for (std::uint32_t y = 0; y < height; ++y)
      for (std::uint32_t x = 0; x < width; ++x) p.row(y)[x] = real(rng_);
    return p;
  }
  static void expect_equal(const Plane& a, const Plane& b) {
    for (std::uint32_t y = 0; y < a.height; ++y)
      EXPECT_EQ(std::memcmp(a.row(y), b.row(y), a.width * sizeof(float)), 0) << "row " << y;
  }
  template <class Work>
  static std::string error_of(const Work& work) {
    try {
      work();
    } catch (const MediaError& error) {
      EXPECT_EQ(error.status(), HostStatus::kRefused);
      return error.what();
    }
    return "no refusal";
  }

  std::filesystem::path directory_;
  vm::PlaneStore store_;
  std::mt19937 rng_{1};
};

TEST_F(MediaTest, ArraysRoundTripBitExactly) {
  for (const char* name : {"a.npy", "a.csv", "A.NPY"})
    for (const auto& [width, height] : {std::pair{1U, 1U}, {3U, 5U}, {17U, 33U}, {100U, 7U}}) {
      const Plane saved = random_plane(width, height);
      saved.row(0)[0] = 1.0F / 3.0F;
      write_array(path(name), saved);
      const Plane loaded = plane(width, height);
      read_array(path(name), loaded);
      expect_equal(saved, loaded);
      EXPECT_FALSE(std::filesystem::exists(path(name) + ".part"));
    }
}

TEST_F(MediaTest, CsvPreservesInfinitiesAndNaN) {
  const Plane p = plane(4, 1);
  p.row(0)[0] = INFINITY, p.row(0)[1] = -INFINITY, p.row(0)[2] = NAN, p.row(0)[3] = 1e-42F;
  write_array(path("a.csv"), p);
  const Plane q = plane(4, 1);
  read_array(path("a.csv"), q);
  EXPECT_EQ(q.row(0)[0], INFINITY);
  EXPECT_EQ(q.row(0)[1], -INFINITY);
  EXPECT_TRUE(std::isnan(q.row(0)[2]));
  EXPECT_EQ(q.row(0)[3], 1e-42F);
}

template <class T>
std::string npy(const std::string& type, const std::string& order, const std::string& shape,
                std::vector<T> cells) {
  std::string header =
      "{'descr': '" + type + "', 'fortran_order': " + order + ", 'shape': " + shape + ", }\n";
  std::string bytes("\x93NUMPY\x01\x00", 8);
  bytes += static_cast<char>(header.size());
  bytes += '\0';
  bytes += header;
  bytes.append(reinterpret_cast<const char*>(cells.data()), cells.size() * sizeof(T));
  return bytes;
}

TEST_F(MediaTest, ReadsNpyOfOtherTypesAndOrders) {
  const Plane p = plane(3, 2);
  const auto expect_123456 = [&](const std::string& what) {
    read_array(path("x.npy"), p);
    for (std::uint32_t i = 0; i < 6; ++i) EXPECT_EQ(p.row(i / 3)[i % 3], static_cast<float>(i + 1)) << what;
  };
  write_bytes("x.npy", npy<double>("<f8", "False", "(2, 3)", {1, 2, 3, 4, 5, 6})), expect_123456("f8");
  write_bytes("x.npy", npy<std::int8_t>("|i1", "False", "(2, 3)", {1, 2, 3, 4, 5, 6})), expect_123456("i1");
  write_bytes("x.npy", npy<std::uint16_t>("<u2", "False", "(2, 3)", {1, 2, 3, 4, 5, 6})), expect_123456("u2");
  write_bytes("x.npy", npy<std::int64_t>("<i8", "False", "(2, 3)", {1, 2, 3, 4, 5, 6})), expect_123456("i8");
  write_bytes("x.npy", npy<std::int32_t>("<i4", "True", "(2, 3)", {1, 4, 2, 5, 3, 6})),
      expect_123456("columns first");
  write_bytes("x.npy", npy<std::uint16_t>(">u2", "False", "(2, 3)", {256, 512, 768, 1024, 1280, 1536}));
  expect_123456("big-endian");
  const Plane row = plane(3, 1);
  write_bytes("x.npy", npy<float>("<f4", "False", "(3,)", {7, 8, 9}));
  read_array(path("x.npy"), row);
  EXPECT_EQ(row.row(0)[2], 9.0F);
}

TEST_F(MediaTest, ReadsCsvWithByteOrderMark) {
  const Plane p = plane(2, 1);
  write_bytes("a.csv",
              "\xEF\xBB\xBF"
              "1,2\r\n");
  read_array(path("a.csv"), p);
  EXPECT_EQ(p.row(0)[0], 1.0F);
  EXPECT_EQ(p.row(0)[1], 2.0F);
}

TEST_F(MediaTest, RefusesDamagedArrays) {
  const Plane p = plane(3, 2);
  const auto said = [&](const std::string& name, const std::string& bytes) {
    write_bytes(name, bytes);
    return error_of([&] { read_array(path(name), p); });
  };
  const auto says = [&](const std::string& message, const std::string& part) {
    EXPECT_NE(message.find(part), std::string::npos) << message;
    EXPECT_NE(message.find(path("")), std::string::npos) << message;
    EXPECT_EQ(message.find('\n'), std::string::npos) << message;
  };
  const std::string good = npy<float>("<f4", "False", "(2, 3)", {1, 2, 3, 4, 5, 6});
  says(said("a.npy", npy<float>("<f4", "False", "(3, 2)", {1, 2, 3, 4, 5, 6})),
       "is 2x3, but the register is 3x2");
  says(said("a.npy", good.substr(0, good.size() - 1)), "ends before its last element");
  says(said("a.npy", good.substr(0, 30)), "ends within its .npy header");
  says(said("a.npy", "hello"), "is not a .npy file");
  says(said("a.npy", npy<float>("<c8", "False", "(2, 3)", {1})), "'<c8'");
  says(said("a.npy", npy<std::uint16_t>("<f2", "False", "(2, 3)", {1})),
       "'<f2'; supported types: float32, float64, int8 to int64, uint8 to uint64 and bool");
  says(said("a.npy", npy<float>("<f4", "False", "(2, 3, 1)", {1})), "3 dimensions");
  says(said("a.npy", npy<float>("<f4", "False", "(99999999999999999999,)", {1})), "damaged shape");
  says(said("a.npy", npy<float>("<f4", "False", "", {1})), "shape");
  says(said("a.csv", "1,2,3\n4,5\n"), "line 2 has 2 numbers, but the lines above have 3");
  says(said("a.csv", "1,2,3\n4,five,6\n"), "line 2, field 2: 'five' is not a number");
  says(said("a.csv", "1,2,3\n"), "is 3x1, but the register is 3x2");
  says(said("a.csv", ""), "is 0x0");
  says(said("a.txt", "1"), "must end in .npy or .csv");
  says(error_of([&] { read_array(path("none.npy"), p); }), "No such file");
  says(error_of([&] { write_array(path("none/none.npy"), p); }), "No such file");
  // A file truncated or changed at any byte is read or refused, without a crash.
  for (std::size_t i = 0; i < good.size(); ++i)
    for (const char c : {'\0', '\xFF', '9', '('}) {
      std::string bad = good;
      bad[i] = c;
      write_bytes("a.npy", bad);
      try {
        read_array(path("a.npy"), p);
      } catch (const MediaError&) {
      }
    }
}

TEST_F(MediaTest, PicturesRoundTrip) {
  for (const char* name : {"p.png", "p.pgm", "p.bmp", "p.jpg"})
    for (const auto& [width, height] : {std::pair{1U, 1U}, {3U, 5U}, {64U, 64U}, {100U, 7U}}) {
      const Plane saved = plane(width, height), loaded = plane(width, height);
      for (std::uint32_t y = 0; y < height; ++y)
        for (std::uint32_t x = 0; x < width; ++x) saved.row(y)[x] = static_cast<float>((2 * x + y) % 256);
      write_image(path(name), saved);
      read_image(path(name), loaded);
      const float tolerance = std::string(name) == "p.jpg" ? 8.0F : 0.0F;  // lossy
      for (std::uint32_t y = 0; y < height; ++y)
        for (std::uint32_t x = 0; x < width; ++x)
          ASSERT_NEAR(loaded.row(y)[x], saved.row(y)[x], tolerance) << name << " " << x << "," << y;
    }
}

TEST_F(MediaTest, RoundsAndClampsGreyLevels) {
  const Plane p = plane(6, 1), q = plane(6, 1);
  const float values[] = {-5, 0.5F, 254.4F, 300, NAN, INFINITY}, want[] = {0, 1, 254, 255, 0, 255};
  std::copy(values, values + 6, p.row(0));
  write_image(path("p.png"), p);
  read_image(path("p.png"), q);
  for (int i = 0; i < 6; ++i) EXPECT_EQ(q.row(0)[i], want[i]) << i;
}

TEST_F(MediaTest, ReadsPgmOfOtherScalesAndKinds) {
  const Plane p = plane(2, 1);
  write_bytes("a.pgm", "P2 # plain\n2 1\n# white\n10\n5 10\n");
  read_image(path("a.pgm"), p);
  EXPECT_EQ(p.row(0)[0], 127.5F);
  EXPECT_EQ(p.row(0)[1], 255.0F);
  write_bytes("a.pgm", std::string("P5 2 1 65535\n\xFF\xFF\x00\x00", 17));
  read_image(path("a.pgm"), p);
  EXPECT_EQ(p.row(0)[0], 255.0F);
  EXPECT_EQ(p.row(0)[1], 0.0F);
}

std::string from_hex(std::string_view digits) {
  std::string bytes;
  for (std::size_t i = 0; i < digits.size(); i += 2)
    bytes += static_cast<char>(std::stoi(std::string(digits.substr(i, 2)), nullptr, 16));
  return bytes;
}

TEST_F(MediaTest, GreyLevelsDoNotDependOnTheFormat) {
  const Plane p = plane(3, 1);
  const auto levels = [&](const std::string& name, std::string_view digits) {
    write_bytes(name, from_hex(digits));
    read_image(path(name), p);
    return std::vector<float>(p.row(0), p.row(0) + 3);
  };
  // Red, green and blue.
  const std::vector<float> colours = levels("a.bmp",
                                            "424d420000000000000036000000280000000300000001000000010018000000"
                                            "00000c0000000000000000000000000000000000000"
                                            "00000ff00ff00ff0000000000");
  EXPECT_EQ(colours, (std::vector<float>{76, 149, 28}));
  EXPECT_EQ(levels("a.png",
                   "89504e470d0a1a0a0000000d4948445200000003000000010802000000948283e30000000e49444154789c63f"
                   "8cfc0c000c6000efb02fe091c16340000000049454e44ae426082"),
            colours);
  EXPECT_EQ(levels("a.png",
                   "89504e470d0a1a0a0000000d4948445200000003000000011002000000c4125fa00000000f49444154789c63f"
                   "8ff9f010c10340038da05fbb95468940000000049454e44ae426082"),
            colours);
  // 0, 32896 and 65535 of 65535.
  EXPECT_EQ(levels("a.png",
                   "89504e470d0a1a0a0000000d49484452000000030000000110000000006e1b972b0000000f49444154789c636"
                   "0606868f8ff1f00068402ff4660deb60000000049454e44ae426082"),
            (std::vector<float>{0, 128, 255}));
  // 200 of any opacity.
  EXPECT_EQ(levels("a.png",
                   "89504e470d0a1a0a0000000d4948445200000003000000010804000000b1e9dc3f0000000f49444154789c633"
                   "8c170a2e1c47f000be603d89138484d0000000049454e44ae426082"),
            (std::vector<float>{200, 200, 200}));
  // 0, 32896 and 65535 of 65535, and 200, with a gamma of 1 before the pixels.
  const std::string gamma = "0000000467414d41000186a031e8965f";
  EXPECT_EQ(
      levels("a.png", "89504e470d0a1a0a0000000d49484452000000030000000110000000006e1b972b" + gamma +
                          "0000000f49444154789c6360606868f8ff1f00068402ff4660deb60000000049454e44ae426082"),
      (std::vector<float>{0, 128, 255}));
  EXPECT_EQ(
      levels("a.png", "89504e470d0a1a0a0000000d4948445200000003000000010804000000b1e9dc3f" + gamma +
                          "0000000f49444154789c6338c170a2e1c47f000be603d89138484d0000000049454e44ae426082"),
      (std::vector<float>{200, 200, 200}));
}

TEST_F(MediaTest, RefusesDamagedPictures) {
  const Plane p = plane(2, 1);
  for (const char* name : {"a.png", "a.pgm", "a.jpg", "a.bmp"}) {
    write_bytes(name, "not a picture at all, but long enough to be one perhaps");
    const std::string said = error_of([&] { read_image(path(name), p); });
    EXPECT_NE(said.find(name), std::string::npos) << said;
    EXPECT_NE(said.find("is not a"), std::string::npos) << said;
  }
  // stb gives no reason for it.
  write_bytes("b.jpg", from_hex("ffd8ffe000104602000001375693912453d38416ffc000110800400040030112000212000312"
                                "00ffda000c03"));
  const Plane square = plane(64, 64);
  EXPECT_TRUE(error_of([&] { read_image(path("b.jpg"), square); }).ends_with("JPEG or BMP picture"));
  write_bytes("c.jpg", "\xff\xd8\xff no");
  EXPECT_NE(error_of([&] { read_image(path("c.jpg"), p); }).find("picture: "), std::string::npos);
  write_bytes("a.pgm", "P5 2 1 255\n\x01");
  EXPECT_NE(error_of([&] { read_image(path("a.pgm"), p); }).find("not a complete PGM"), std::string::npos);
  write_image(path("b.png"), p);
  const Plane other = plane(3, 3);
  EXPECT_NE(error_of([&] { read_image(path("b.png"), other); }).find("is 2x1, but the register is 3x3"),
            std::string::npos);
  EXPECT_NE(error_of([&] { write_image(path("b.gif"), p); }).find("must end in .png"), std::string::npos);
}

TEST_F(MediaTest, HostReportsErrorsWithoutThrowing) {
  const std::atomic<bool> stop{false};
  LocalHost host({{"speed", 2.0F}}, stop);
  const Plane p = plane(2, 1);
  EXPECT_EQ(host.open_array(path("none.npy"), p), HostStatus::kRefused);
  EXPECT_NE(host.message().find("none.npy"), std::string::npos);
  EXPECT_EQ(host.save_array(path("a.npy"), p), HostStatus::kOk);
  EXPECT_EQ(host.open_image(path("a.npy"), p), HostStatus::kRefused);
  EXPECT_EQ(host.sense("proximity", p), HostStatus::kRefused);
  EXPECT_EQ(host.message(), "there is no surface: run with --shm NAME");
  EXPECT_EQ(host.parameter("speed"), 2.0F);
  EXPECT_FALSE(host.parameter("gain"));
  EXPECT_EQ(host.tick(), 0.0);
  EXPECT_EQ(host.step(), HostStatus::kOk);
  EXPECT_EQ(host.tick(), 1.0);
}

}  // namespace
}  // namespace apron::run
