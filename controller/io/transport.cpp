#include "controller/io/transport.hpp"

#include <lcm/lcm-cpp.hpp>
#include <stdexcept>
#include <vector>

namespace stance::io {

struct Transport::Impl {
  struct Subscription {
    std::function<void(Bytes)> handler;
    static void receive(const lcm::ReceiveBuffer* buffer, const std::string& /*channel*/, Subscription* self) {
      self->handler({static_cast<const std::uint8_t*>(buffer->data), buffer->data_size});
    }
  };
  explicit Impl(const std::string& url) : lcm(url) {}

  lcm::LCM lcm;
  std::vector<std::unique_ptr<Subscription>> subscriptions;
};

Transport::Transport(const std::string& url) : impl_(std::make_unique<Impl>(url)) {
  if (!impl_->lcm.good()) {
    throw std::runtime_error(
        "LCM cannot use " + url +
        ": is there a multicast route? `stance run` makes one, or: ip route add 224.0.0.0/4 dev lo");
  }
}

Transport::~Transport() = default;

void Transport::subscribe(const char* channel, std::function<void(Bytes)> handler) {
  auto& subscription = impl_->subscriptions.emplace_back(std::make_unique<Impl::Subscription>());
  subscription->handler = std::move(handler);
  impl_->lcm.subscribeFunction(channel, &Impl::Subscription::receive, subscription.get());
}

bool Transport::handle(int timeout_ms) { return impl_->lcm.handleTimeout(timeout_ms) > 0; }

bool Transport::publish(const char* channel, Bytes bytes) noexcept {
  // lcm_publish of the C interface: lcm-cpp's would build a std::string of the channel.
  return lcm_publish(impl_->lcm.getUnderlyingLCM(), channel, bytes.data(), static_cast<unsigned>(bytes.size())) == 0;
}

}  // namespace stance::io
