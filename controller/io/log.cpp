#include "controller/io/log.hpp"

#include <lcm/lcm-cpp.hpp>
#include <stdexcept>

namespace stance::io {

struct LogWriter::Impl {
  explicit Impl(const std::string& file) : log(file, "w") {}
  lcm::LogFile log;
};

LogWriter::LogWriter(const std::string& file) : impl_(std::make_unique<Impl>(file)) {
  if (!impl_->log.good()) throw std::runtime_error("cannot create the log " + file);
}
LogWriter::~LogWriter() = default;

void LogWriter::write(std::int64_t utime, const std::string& channel, Bytes bytes) {
  lcm::LogEvent event{};
  event.timestamp = utime;
  event.channel = channel;
  event.datalen = static_cast<std::int32_t>(bytes.size());
  event.data = const_cast<std::uint8_t*>(bytes.data());  // LCM's event is not const-correct; it only reads
  if (impl_->log.writeEvent(&event) != 0) throw std::runtime_error("cannot write to the log: is the disk full?");
}

struct LogReader::Impl {
  explicit Impl(const std::string& file) : log(file, "r") {}
  lcm::LogFile log;
};

LogReader::LogReader(const std::string& file) : impl_(std::make_unique<Impl>(file)) {
  if (!impl_->log.good()) throw std::runtime_error("cannot open the log " + file);
}
LogReader::~LogReader() = default;

bool LogReader::next(LogEvent& event) {
  const lcm::LogEvent* read = impl_->log.readNextEvent();
  if (read == nullptr) return false;
  event.utime = read->timestamp;
  event.channel = read->channel;
  event.bytes = {static_cast<const std::uint8_t*>(read->data), static_cast<std::size_t>(read->datalen)};
  return true;
}

}  // namespace stance::io
