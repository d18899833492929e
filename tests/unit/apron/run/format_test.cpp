// `apron fmt` on files.
#include "apron/run/Commands.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <sstream>

namespace apron::run {
namespace {

class FormatCommand : public testing::Test {
 protected:
  void SetUp() override {
    file_ =
        (std::filesystem::path(testing::TempDir()) / ("fmt_" + std::to_string(getpid()) + ".aps")).string();
  }
  void TearDown() override { std::filesystem::remove(file_); }
  void put(const std::string& text) const { std::ofstream(file_) << text; }
  std::string get() const {
    std::ostringstream text;
    text << std::ifstream(file_).rdbuf();
    return text.str();
  }
  int format(bool write, bool only_check) {
    Options options;
    options.files = {file_};
    options.write = write;
    options.only_check = only_check;
    testing::internal::CaptureStdout();
    testing::internal::CaptureStderr();
    const int status = format_programs(options);
    out_ = testing::internal::GetCapturedStdout();
    err_ = testing::internal::GetCapturedStderr();
    return status;
  }
  std::string file_, out_, err_;
};

TEST_F(FormatCommand, WritesToTheOutputTheFileOrNowhere) {
  put("a=1\n");
  EXPECT_EQ(format(false, false), kDone);
  EXPECT_EQ(out_, "a = 1\n");
  EXPECT_EQ(format(false, true), kRunFailed);
  EXPECT_EQ(out_, file_ + "\n");
  EXPECT_EQ(get(), "a=1\n");
  EXPECT_EQ(format(true, false), kDone);
  EXPECT_EQ(get(), "a = 1\n");
  EXPECT_EQ(format(false, true), kDone);
  EXPECT_EQ(out_, "");
}

TEST_F(FormatCommand, LeavesAWrongProgramAloneAndSaysWhy) {
  put("a = 'open\n");
  EXPECT_EQ(format(true, false), kWrongInput);
  EXPECT_EQ(get(), "a = 'open\n");
  EXPECT_NE(err_.find(":1:5: error: this text has no closing quote"), std::string::npos) << err_;
}

}  // namespace
}  // namespace apron::run
