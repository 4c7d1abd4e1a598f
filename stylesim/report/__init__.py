"""Tables, figures and the HTML report; the only package that imports plotting."""
