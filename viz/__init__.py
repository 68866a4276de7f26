"""Pictures and recordings of what the other rooms did; reads everything, changes nothing."""
