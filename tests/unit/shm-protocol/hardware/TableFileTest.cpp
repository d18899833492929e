// Files of tables: what they mean, and one line for each mistake.
#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <random>

#include "common/text/Number.h"
#include "common/text/Words.h"
#include "shm-protocol/hardware/bridge/TableFile.h"

namespace hardware {
namespace {

const std::string kHead = "name = \"t\"\npitch = 1.5\nperiod_us = 5000\n";
const std::string kBoard = "[[board]]\nid = \"a\"\ndevice = \"/dev/ttyUSB0\"\nat = [0, 8]\n";

class TableFile : public testing::Test {
 protected:
  std::string write(const std::string& text) {
    path_ = testing::TempDir() + "table-" + std::to_string(::getpid()) + ".toml";
    std::ofstream(path_) << text;
    return path_;
  }
  // The error's line without the name of the file.
  std::string error(const std::string& text) {
    try {
      read_table(write(text));
    } catch (const std::invalid_argument& e) {
      const std::string line = e.what();
      EXPECT_EQ(line.find('\n'), line.npos) << line;
      EXPECT_TRUE(line.starts_with(path_ + ":")) << line;
      return line.substr(std::min(line.size(), path_.size() + 1));
    }
    return "none";
  }
  ~TableFile() override { std::filesystem::remove(path_); }
  std::string path_;
};

TEST_F(TableFile, ReadsBoards) {
  const TableSpec spec =
      read_table(write(kHead + "holes = true\n" + kBoard +
                       "[[board]]\ndevice = \"tcp:127.0.0.1:5000\"\nat = [0, 0]\nturn = 270\n"
                       "mirror = true\nsize = [4, 6]\nwithout = [\"load\"]\n"));
  EXPECT_EQ(spec.name, "t");
  EXPECT_EQ(spec.pitch, 1.5);
  EXPECT_EQ(spec.period_us, 5000u);
  EXPECT_TRUE(spec.holes);
  ASSERT_EQ(spec.boards.size(), 2u);
  EXPECT_EQ(spec.boards[0].column, 8u);
  EXPECT_EQ(spec.boards[0].line, 5u);
  EXPECT_EQ(spec.boards[1].turn, 270);
  EXPECT_TRUE(spec.boards[1].mirror);
  EXPECT_EQ(spec.boards[1].size, (std::pair<std::uint32_t, std::uint32_t>{4, 6}));
  EXPECT_EQ(spec.boards[1].without, std::vector<std::string>{"load"});
}

// As programs write them.
TEST_F(TableFile, TextsAndNumbersAreReadAsWritten) {
  std::mt19937 random(3);
  for (int round = 0; round < 200; ++round) {
    const float pitch =
        std::ldexp(1 + static_cast<float>(random()) * 0x1p-32F, static_cast<int>(random() % 40) - 20);
    std::string device = "/";
    for (int i = 0; i < 20; ++i) device += random() % 8 ? static_cast<char>(random() % 127 + 1) : '"';
    device += "\u00e9";
    const TableSpec spec =
        read_table(write("name = \"t\"\nperiod_us = 5000\npitch = " + common::shortest(pitch) +
                         "\n[[board]]\nat = [0, 0]\ndevice = " + common::toml_text(device)));
    EXPECT_EQ(static_cast<float>(*spec.pitch), pitch);
    EXPECT_EQ(spec.boards[0].port.text, device);
  }
}

TEST_F(TableFile, MistakesAreNamedWithTheirLine) {
  std::string many_parts = "a";
  for (int i = 0; i < 100000; ++i) many_parts += ".a";
  const std::pair<std::string, std::string> kMistakes[] = {
      {kHead + kBoard + "turn = 45\n", "8: board 'a': turn is 45, must be 0, 90, 180 or 270"},
      {kHead + many_parts + " = 1\n", "4: more than 100 dots in one key or text"},
      {kHead + "[" + many_parts + "]\n", "4: more than 100 dots in one key or text"},
      {kHead + kBoard + "tilt = 3\n", "8: board 'a': unknown key 'tilt'; known are id, device"},
      {kHead + "colour = 1\n" + kBoard, "4: unknown key 'colour'"},
      {kHead + kBoard + kBoard, "8: board 'a': line 4 has a board of the same id"},
      {kHead + kBoard + "[[board]]\nid = \"b\"\ndevice = \"/dev/ttyUSB0\"\nat = [0, 0]\n",
       "8: board 'b': device /dev/ttyUSB0 is also that of line 4"},
      {kHead + "[[board]]\nid = \"a\"\ndevice = \"/dev/x\"\n", "4: board 'a': at is missing"},
      {kHead + "[[board]]\nid = \"a\"\nat = [0, 0]\n", "4: board 'a': device is missing"},
      {kHead + "[[board]]\ndevice = \"tcp:x\"\nat = [0, 0]\n", "4: board: 'tcp:x' is not tcp:HOST:PORT"},
      {kHead + "[[board]]\ndevice = \"/dev/x\"\nat = [0, -1]\n", "6: board: at must be [row, column]"},
      {kHead + "[[board]]\ndevice = \"/dev/x\"\nat = [0.5, 1]\n", "6: board: at must be [row, column]"},
      {kHead + kBoard + "mirror = \"yes\"\n", "8: board 'a': mirror must be true or false"},
      {kHead + kBoard + "size = [0, 4]\n", "8: board 'a': size must be"},
      {kHead + kBoard + "baud = 12345\n",
       "8: board 'a': baud is 12345, must be a usual speed in bits a second; 9600"},
      {kHead + kBoard + "baud = 99999999999\n", "8: board 'a': baud is 99999999999, must be a usual speed"},
      {kHead + kBoard + "baud = -3\n", "8: board 'a': baud is -3, must be a usual speed"},
      {kHead + kBoard + "baud = 0\n", "8: board 'a': baud is 0, must be a usual speed"},
      {"name = \"t\"\n" + kBoard, "1: period_us is missing"},
      {"name = \"t\"\nperiod_us = 5\n" + kBoard, "2: period_us is 5, must be"},
      {"name = \"t\"\nperiod_us = 5000\npitch = 0\n" + kBoard, "3: pitch must be a length above 0"},
      {"name = \"t\"\nperiod_us = 5000\ncalibration = \"\"\n" + kBoard,
       "3: calibration is empty: must name a file"},
      {kHead + "board = 3\n", "4: board must be [[board]] tables"},
      {kHead, " has no [[board]]"},
      {kHead + kBoard + "turn = ", "8: "},
      {kHead + "[[board]]\nid = \"a", "5: "},
  };
  for (const auto& [text, expected] : kMistakes) {
    const std::string line = error(text);
    EXPECT_TRUE(line.starts_with(expected)) << line << "\n  expected: " << expected;
  }
}

// A file that ends early is a mistake wherever it ends, or a smaller table, but never anything else.
TEST_F(TableFile, TruncatedFilesAreMistakesOrSmallerTables) {
  const std::string whole =
      kHead + kBoard + "[[board]]\nid = \"b\"\ndevice = \"/dev/y\"\nat = [0, 0]\nturn = 90\n";
  for (std::size_t bytes = 0; bytes < whole.size(); ++bytes) {
    try {
      EXPECT_LE(read_table(write(whole.substr(0, bytes))).boards.size(), 2u);
    } catch (const std::invalid_argument& e) {
      EXPECT_EQ(std::string(e.what()).find('\n'), std::string::npos) << e.what();
    }
  }
}

}  // namespace
}  // namespace hardware
