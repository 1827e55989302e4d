"""One page of HTML about an agent, to be read without anything else and sent to others."""
