import gzip

import pytest

from stylesim import xmlfiles as xml
from stylesim.errors import InputError

BOMB = """<?xml version="1.0"?>
<!DOCTYPE osm [<!ENTITY a "aaaaaaaaaa"><!ENTITY b "&a;&a;&a;&a;&a;&a;&a;&a;&a;&a;"><!ENTITY c "&b;&b;&b;&b;&b;">]>
<osm>&c;</osm>"""
FILE = '<!DOCTYPE osm [<!ENTITY x SYSTEM "file:///etc/passwd">]><osm>&x;</osm>'
REMOTE = '<!DOCTYPE osm SYSTEM "http://localhost/x.dtd"><osm/>'


def written(tmp_path, content, name="map.osm"):
    path = tmp_path / name
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    return path


@pytest.mark.parametrize(
    "content",
    [BOMB, FILE, REMOTE, FILE.encode("utf-16"), "<!-- c --><?p i?>" + FILE],
    ids=["bomb", "file", "remote", "utf-16", "after a comment"],
)
def test_document_types_are_refused(tmp_path, content):
    path = written(tmp_path, content)
    with pytest.raises(InputError, match="declares a document type") as error:
        xml.parse(path)
    assert str(path) in str(error.value)
    assert xml.root_name(path) == ""


@pytest.mark.parametrize(
    ("content", "says"),
    [
        (b"", "damaged or no XML"),
        (b"<osm>", "damaged or no XML"),
        (b"<osm><node></osm>", "damaged or no XML"),
        (b"<osm>&undeclared;</osm>", "damaged or no XML"),
        (b"<osm/><osm/>", "damaged or no XML"),
        (b"<osm/><!DOCTYPE osm>", "damaged or no XML"),
        (b"\xff\xfe<", "damaged or no XML"),
        (b'<?xml version="1.0" encoding="no-such"?><osm/>', "damaged or no XML"),
        (b"<OpenDRIVE/>", "its root is <OpenDRIVE>"),
    ],
)
def test_what_is_no_map_is_named(tmp_path, content, says):
    path = written(tmp_path, content)
    with pytest.raises(InputError, match=says) as error:
        xml.parse(path, root="osm")
    assert str(path) in str(error.value)


def test_sizes_are_bounded_also_when_packed(tmp_path, monkeypatch):
    monkeypatch.setattr(xml, "MAX_BYTES", 1000)
    packed = written(tmp_path, gzip.compress(b"<osm>" + b" " * 100_000 + b"</osm>"), "map.osm.gz")
    assert packed.stat().st_size < 1000
    with pytest.raises(InputError, match="larger than"):
        xml.parse(packed)
    with pytest.raises(InputError, match="larger than"):
        xml.parse(written(tmp_path, b"<osm>" + b" " * 2000 + b"</osm>"))
    with pytest.raises(InputError, match="truncated gzip"):
        xml.parse(written(tmp_path, gzip.compress(b"<osm/>" * 50)[:-9], "cut.osm.gz"))
    with pytest.raises(InputError, match="cannot read"):
        xml.parse(tmp_path / "absent.osm")


def test_sound_files_are_read(tmp_path):
    path = written(tmp_path, "<?xml version='1.0'?><!-- made --><osm a='1'><node id='2'/></osm>")
    assert xml.parse(path, root="osm").find("node").get("id") == "2"
    assert xml.root_name(path) == "osm"
    assert xml.root_name(written(tmp_path, bytes(range(256)))) == ""
