// SPDX-License-Identifier: Apache-2.0
// A node on Fast DDS, which is no code of ours: it says "ready", and then
//   node FILE N [stamped]  writes each of N scans into FILE, drives with 0.3 m/s, and ends
//   node                   answers each scan with map -> odom = identity until it is killed
#include <chrono>
#include <cstdlib>
#include <fstream>
#include <iostream>
#include <thread>

#include <fastdds/dds/domain/DomainParticipant.hpp>
#include <fastdds/dds/domain/DomainParticipantFactory.hpp>
#include <fastdds/dds/publisher/DataWriter.hpp>
#include <fastdds/dds/publisher/Publisher.hpp>
#include <fastdds/dds/subscriber/DataReader.hpp>
#include <fastdds/dds/subscriber/SampleInfo.hpp>
#include <fastdds/dds/subscriber/Subscriber.hpp>
#include <fastdds/rtps/transport/UDPv4TransportDescriptor.h>
#include <fastrtps/utils/IPLocator.h>

#include "rosPubSubTypes.h"

using namespace eprosima::fastdds::dds;
using Scan = sensor_msgs::msg::dds_::LaserScan_;

int main(int argc, char** argv)
{
    const int wanted = argc > 2 ? std::atoi(argv[2]) : 0;
    const char* domain = std::getenv("ROS_DOMAIN_ID");
    const char* own_ip = std::getenv("NODE_IP");  // and that of the robot, where they are not the loopback's
    const char* robot_ip = std::getenv("ROBOT_IP");
    const char* range = std::getenv("ROS_AUTOMATIC_DISCOVERY_RANGE");
    DomainParticipantQos own;
    if (own_ip || (range && std::string(range) == "LOCALHOST"))
    {   // as rmw_fastrtps does for it; else default settings
        auto udp = std::make_shared<eprosima::fastdds::rtps::UDPv4TransportDescriptor>();
        udp->interfaceWhiteList.push_back(own_ip ? own_ip : "127.0.0.1");
        udp->maxInitialPeersRange = 32;
        own.transport().use_builtin_transports = false;
        own.transport().user_transports.push_back(udp);
        eprosima::fastrtps::rtps::Locator_t peer;
        eprosima::fastrtps::rtps::IPLocator::setIPv4(peer, robot_ip ? robot_ip : "127.0.0.1");
        own.wire_protocol().builtin.initialPeersList.push_back(peer);
    }
    auto* participant = DomainParticipantFactory::get_instance()->create_participant(
        domain ? std::atoi(domain) : 0, own);
    TypeSupport scan_type(new sensor_msgs::msg::dds_::LaserScan_PubSubType());
    TypeSupport twist_type(new geometry_msgs::msg::dds_::Twist_PubSubType());
    if (argc > 3)
        twist_type = TypeSupport(new geometry_msgs::msg::dds_::TwistStamped_PubSubType());
    TypeSupport tf_type(new tf2_msgs::msg::dds_::TFMessage_PubSubType());
    for (auto& type : {scan_type, twist_type, tf_type})
        type.register_type(participant);
    auto* scans = participant->create_topic("rt/scan", scan_type.get_type_name(), TOPIC_QOS_DEFAULT);
    auto* twists = participant->create_topic("rt/cmd_vel", twist_type.get_type_name(), TOPIC_QOS_DEFAULT);
    auto* links = participant->create_topic("rt/tf", tf_type.get_type_name(), TOPIC_QOS_DEFAULT);
    DataReaderQos listens;
    listens.reliability().kind = BEST_EFFORT_RELIABILITY_QOS;  // as for sensor data
    listens.history().depth = 100;
    DataWriterQos says;
    says.reliability().kind = RELIABLE_RELIABILITY_QOS;
    says.history().depth = 10;
    auto* reader = participant->create_subscriber(SUBSCRIBER_QOS_DEFAULT)->create_datareader(scans, listens);
    auto* publisher = participant->create_publisher(PUBLISHER_QOS_DEFAULT);
    auto* drives = publisher->create_datawriter(twists, says);
    auto* localises = publisher->create_datawriter(links, says);

    std::ofstream out(wanted ? argv[1] : "/dev/null", std::ios::binary);
    Scan scan;
    SampleInfo info;
    std::cout << "ready" << std::endl;
    for (int taken = 0; wanted == 0 || taken < wanted;)
    {
        if (!reader->wait_for_unread_message({10, 0}))
        {
            std::cerr << "no scan for 10 s after " << taken << std::endl;
            if (wanted)
                return 1;
            continue;
        }
        while (reader->take_next_sample(&scan, &info) == ReturnCode_t::RETCODE_OK)
        {
            if (!info.valid_data)
                continue;
            const auto now = std::chrono::system_clock::now().time_since_epoch();
            const int64_t now_ns = std::chrono::nanoseconds(now).count();
            const auto& head = scan.header();
            const uint32_t n[4] = {uint32_t(head.stamp().sec()), head.stamp().nanosec(),
                                   uint32_t(scan.ranges().size()), uint32_t(scan.intensities().size())};
            const float f[7] = {scan.angle_min(), scan.angle_max(), scan.angle_increment(),
                                scan.time_increment(), scan.scan_time(), scan.range_min(), scan.range_max()};
            out.write((const char*)&now_ns, 8).write((const char*)n, sizeof n).write((const char*)f, sizeof f);
            out.write((const char*)scan.ranges().data(), 4 * n[2]);
            out.write((const char*)scan.intensities().data(), 4 * n[3]);
            out << head.frame_id() << '\n';
            ++taken;

            geometry_msgs::msg::dds_::TwistStamped_ stamped;
            stamped.twist().linear().x() = 0.3;
            tf2_msgs::msg::dds_::TFMessage_ tf;
            tf.transforms().resize(1);
            tf.transforms()[0].header().stamp() = head.stamp();
            tf.transforms()[0].header().frame_id() = "map";
            tf.transforms()[0].child_frame_id() = "odom";
            tf.transforms()[0].transform().rotation().w() = 1.0;
            if (!wanted)
                localises->write(&tf);
            else if (argc > 3)
                drives->write(&stamped);
            else
                drives->write(&stamped.twist());
        }
    }
    out.close();
    std::this_thread::sleep_for(std::chrono::milliseconds(200));
    return 0;
}
