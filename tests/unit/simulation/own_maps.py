"""Small maps that tests write: OpenStreetMap, OpenDRIVE, and a SUMO network of the shipped sources."""

from __future__ import annotations

from pathlib import Path

from stylesim.scenario import load_scenario
from stylesim.simulation.sumo.network import compiled_network
from stylesim.simulation.sumo.options import sumo_options_of

OSM = """<?xml version="1.0" encoding="UTF-8"?>
<osm version="0.6" generator="test">
 <bounds minlat="52.2600" minlon="10.5200" maxlat="52.2680" maxlon="10.5330"/>
 <node id="1" lat="52.2640" lon="10.5200"/>
 <node id="2" lat="52.2640" lon="10.5260"><tag k="highway" v="traffic_signals"/></node>
 <node id="3" lat="52.2640" lon="10.5330"/>
 <node id="4" lat="52.2610" lon="10.5260"/>
 <node id="5" lat="52.2672" lon="10.5260"/>
 <node id="6" lat="52.2672" lon="10.5262"/>
 <way id="10"><nd ref="1"/><nd ref="2"/><nd ref="3"/>
  <tag k="highway" v="primary"/><tag k="lanes" v="4"/><tag k="maxspeed" v="50"/><tag k="sidewalk" v="both"/></way>
 <way id="11"><nd ref="4"/><nd ref="2"/><nd ref="5"/>
  <tag k="highway" v="secondary"/><tag k="lanes" v="2"/><tag k="maxspeed" v="50"/></way>
 <way id="12"><nd ref="5"/><nd ref="6"/><tag k="highway" v="footway"/></way>
</osm>
"""

XODR = """<?xml version="1.0" encoding="UTF-8"?>
<OpenDRIVE>
 <header revMajor="1" revMinor="4" name="test" version="1.00" north="0" south="0" east="0" west="0"/>
 <road name="" length="600.0" id="1" junction="-1">
  <link/>
  <type s="0" type="town"><speed max="20" unit="m/s"/></type>
  <planView><geometry s="0" x="0" y="0" hdg="0" length="600.0"><line/></geometry></planView>
  <elevationProfile/><lateralProfile/>
  <lanes><laneSection s="0">
   <left><lane id="1" type="driving" level="false"><link/><width sOffset="0" a="3.5" b="0" c="0" d="0"/></lane></left>
   <center><lane id="0" type="none" level="false"><link/></lane></center>
   <right>
    <lane id="-1" type="driving" level="false"><link/><width sOffset="0" a="3.5" b="0" c="0" d="0"/></lane>
    <lane id="-2" type="driving" level="false"><link/><width sOffset="0" a="3.5" b="0" c="0" d="0"/></lane>
   </right>
  </laneSection></lanes>
 </road>
</OpenDRIVE>
"""


def write_osm(folder: Path) -> Path:
    path = folder / "town.osm"
    path.write_text(OSM)
    return path


def write_xodr(folder: Path) -> Path:
    path = folder / "road.xodr"
    path.write_text(XODR)
    return path


def write_net(folder: Path, scenario: str = "yellow_light") -> Path:
    """The compiled network of a shipped scenario, as a user's own file."""
    shipped = load_scenario(scenario)
    made = compiled_network(shipped, sumo_options_of(shipped), speed_limit_mps=13.889)
    path = folder / "mine.net.xml"
    path.write_bytes(made.read_bytes())
    return path
